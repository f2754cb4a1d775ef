import pytest

from agents.markdown import put, table
from hoof_env.errors import DataFileError


def test_a_table():
    assert table(["a", "b"], [["1", "2"], ["3"]]) == "| a | b |\n| --- | --- |\n| 1 | 2 |\n| 3 |  |"


def test_a_table_goes_between_its_marks():
    text = "a\n<!-- bar -->\nold\n<!-- /bar -->\nb\n"
    assert put(text, "bar", r"new \1") == "a\n<!-- bar -->\nnew \\1\n<!-- /bar -->\nb\n"
    with pytest.raises(DataFileError, match="<!-- audit -->"):
        put(text, "audit", "")
