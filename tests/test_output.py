"""What commands write."""

import os
import threading
from pathlib import Path

import pytest

from hoof_env import cli, records
from hoof_env._output import free_memory, markdown_table, new_file, staged
from hoof_env.errors import OutputError


def test_a_row_that_is_shorter_than_the_head_ends_in_empty_cells():
    assert markdown_table(["a", "b"], [["1", "2"], ["3"]]) == "| a | b |\n|---|---|\n| 1 | 2 |\n| 3 |  |"
    assert markdown_table(iter(["", ""]), iter([iter(["1 | 2", "3"])])) == "|  |  |\n|---|---|\n| 1 | 2 | 3 |"


def contents(folder):
    """The files in a folder by name."""
    return {path.name: path.read_text() for path in folder.iterdir()}


def test_of_many_commands_that_write_one_file_at_once_one_does_and_nothing_is_lost(tmp_path):
    """Pairs of files: all commands see none at the beginning, and all end at the same time."""
    count = 8
    together = threading.Barrier(count)
    refused = []

    def command(number):
        path = tmp_path / "a.csv"
        try:
            with new_file(path, False, [tmp_path / "b.xml"]) as file:
                file.write_text(f"a{number}")
                file.with_name("b.xml").write_text(f"b{number}")
                together.wait()
        except OutputError as error:
            refused.append(str(error))

    threads = [threading.Thread(target=command, args=(number,)) for number in range(count)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(refused) == count - 1
    pairs = [tmp_path, *tmp_path.glob("kept-*")]
    found = sorted((pair / "a.csv").read_text() + (pair / "b.xml").read_text() for pair in pairs)
    assert found == [f"a{number}b{number}" for number in range(count)]
    assert len(list(tmp_path.iterdir())) == 2 + count - 1
    assert all(any(str(pair) in error for error in refused) for pair in pairs[1:])


def test_with_leave_to_overwrite_the_last_one_stays(tmp_path):
    (tmp_path / "a.csv").write_text("old")
    with new_file(tmp_path / "a.csv", True) as file:
        file.write_text("new")
        assert (tmp_path / "a.csv").read_text() == "old"
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("a.csv", "new")]


def test_a_pair_of_which_one_is_there_is_kept_as_a_pair(tmp_path):
    def write():
        with staged(tmp_path, ("a.csv", "b.xml")) as stage:
            (stage / "a.csv").write_text("a")
            (stage / "b.xml").write_text("b")
            (tmp_path / "b.xml").write_text("theirs")

    with pytest.raises(OutputError, match=r"b\.xml' exists already"):
        write()
    assert [path.name for path in tmp_path.iterdir() if path.is_file()] == ["b.xml"]
    (kept,) = tmp_path.glob("kept-*")
    assert contents(kept) == {"a.csv": "a", "b.xml": "b"}
    (tmp_path / "usual").mkdir()
    assert kept.stat().st_mode == (tmp_path / "usual").stat().st_mode


@pytest.mark.parametrize(
    ("command", "name"),
    [
        (["export", "--seconds", "0.1"], "x.mot"),
        (["render", "--size", "480", "270", "--seconds", "0.04"], "x.gif"),
        (["mjcf"], "x.xml"),
    ],
)
def test_a_file_that_appears_while_a_command_works_stays(command, name, tmp_path, capsys, monkeypatch):
    if command[0] == "render":
        pytest.importorskip("pygame")
        pytest.importorskip("imageio_ffmpeg")
    out = tmp_path / name
    # As if it came right after the command has looked
    monkeypatch.setattr("hoof_env._output.check_new", lambda *_: out.write_text("theirs") and "")
    assert cli.main([*command, "--out", str(out)]) == 2
    said = capsys.readouterr()
    assert said.err.startswith(f"hoof-env: error: {str(out)!r} exists already: it was written meanwhile")
    assert said.out == ""
    assert out.read_text() == "theirs"
    assert {path.name for path in tmp_path.glob("kept-*/*")} == {path.name for path in records.files_of(out)}
    assert len(list(tmp_path.iterdir())) == 2


def test_without_proc_free_memory_is_the_machines(monkeypatch):
    """As on macOS, where nothing tells what others have taken."""

    def absent(path, *args, **options):
        raise FileNotFoundError(path)

    monkeypatch.setattr(Path, "read_text", absent)
    sizes = {"SC_PHYS_PAGES": 3_000_000, "SC_PAGE_SIZE": 4096}
    monkeypatch.setattr(os, "sysconf", sizes.__getitem__, raising=False)
    assert free_memory() == 3_000_000 * 4096
    monkeypatch.delattr(os, "sysconf")
    assert free_memory() == float("inf")
