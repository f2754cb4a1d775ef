"""The tab that most tests here ask."""

import math

import pytest


@pytest.fixture
def page(tmp_path):
    """A tab that writes its recordings into the folder of a test."""
    # Here, as there may be no Bokeh
    from tests.view.pages import Page

    made = Page(tmp_path)
    yield made
    made.tab.close()


@pytest.fixture(autouse=True)
def _patient(monkeypatch):
    """However slow the machine is, a tick goes on by all of its time."""
    pytest.importorskip("bokeh")
    monkeypatch.setattr("hoof_env.view.player.MAX_WORK_SECONDS", math.inf)
