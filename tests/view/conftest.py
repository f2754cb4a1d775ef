"""The tab that most tests here ask."""

import pytest


@pytest.fixture
def page(tmp_path):
    """A tab that writes its recordings into the folder of a test."""
    # Here, as there may be no Bokeh
    from tests.view.pages import Page

    made = Page(tmp_path)
    yield made
    made.tab.close()
