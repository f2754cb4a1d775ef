"""What commands write."""

from hoof_env._output import markdown_table


def test_a_row_that_is_shorter_than_the_head_ends_in_empty_cells():
    assert markdown_table(["a", "b"], [["1", "2"], ["3"]]) == "| a | b |\n|---|---|\n| 1 | 2 |\n| 3 |  |"
    assert markdown_table(iter(["", ""]), iter([iter(["1 | 2", "3"])])) == "|  |  |\n|---|---|\n| 1 | 2 | 3 |"
