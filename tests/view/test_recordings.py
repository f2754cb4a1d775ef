"""Recordings of what a tab shows: formats, films, closed tabs, the episode they describe."""

from __future__ import annotations

import pytest

from hoof_env import film, records

pytest.importorskip("bokeh")


from hoof_env.view.recording import FORMATS
from tests.view.pages import Page


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_recording_is_written_in_each_format(page, suffix, tmp_path):
    if suffix in (".mp4", ".gif"):
        pytest.importorskip("imageio_ffmpeg")
        pytest.importorskip("pygame")
    assert page.ask("record", suffix=suffix)["recording"] is True
    page.tick(0.2)
    writes = []
    recording = page.player.recording
    recording._tell = lambda *what: writes.append(what)
    page.player.recording = None
    recording.write().join()
    assert writes[0][1] == "note", writes
    (path,) = tmp_path.glob(f"horseleg-v0-*{suffix}")
    assert path.stat().st_size > 1000


def test_a_film_begins_with_the_recording(page, monkeypatch):
    pytest.importorskip("imageio_ffmpeg")
    pytest.importorskip("pygame")
    made = []
    monkeypatch.setattr(film, "write_film", lambda frames, path, fps: made.extend(frames))
    page.tick(0.6)
    page.ask("record", suffix=".gif")
    recording = page.player.recording
    page.tick(0.4)
    page.player.recording = None
    recording.write().join()
    assert 10 <= len(made) <= 11  # 0.4 s


def test_a_tab_that_is_closed_during_a_recording_writes_it(tmp_path, capfd):
    page = Page(tmp_path)
    page.ask("record", suffix=".csv")
    page.tick(0.2)
    recording = page.player.recording
    write = recording.write
    threads = []
    recording.write = lambda: threads.append(write())
    page.tab.close()
    page.tab._worker._thread.join()
    threads[0].join()
    (path,) = tmp_path.glob("*.csv")
    assert str(path) in capfd.readouterr().out
    assert len(path.read_text().splitlines()) > 100


@pytest.mark.parametrize("end", ["reset", "episode"])
def test_a_recording_describes_its_own_episode_when_the_next_one_has_begun(end, tmp_path, monkeypatch):
    page = Page(tmp_path, arguments={"episode_seconds": 0.5}, policy="walk", seed=3)
    described = []
    monkeypatch.setattr(records, "write", lambda columns, about, path: described.append(about))
    page.ask("touch", setting="friction", value=0.5)
    page.ask("record", suffix=".csv")
    recording = page.player.recording
    page.tick(0.2)
    if end == "reset":
        page.ask("reset", seed=9, policy="run")
    else:
        page.tick(0.6)
    page.ask("touch", setting="friction", value=0.7)
    assert page.player.simulation.seed != 3
    recording.write().join()
    for about in described:
        assert (about["seed"], about["policy"]) == (3, "walk")
        assert about["parameters"]["friction"] == 0.5
    assert described
    page.tab.close()
