"""The examples in the docstrings of public names run, and give what they say."""

import doctest
import re
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

PAGES = Path(__file__).parents[1] / "docs" / "api"
NAMES = re.findall(
    r"^\.\. auto(?:class|function):: (\S+)",
    "".join(page.read_text() for page in PAGES.glob("*.md")),
    re.MULTILINE,
)


def example_of(name):
    """The example in the docstring of a name, None without one."""
    module, _, attribute = name.rpartition(".")
    found = getattr(import_module(module), attribute, None)
    return doctest.DocTestParser().get_doctest(getattr(found, "__doc__", "") or "", {}, name, name, 0)


WITH_EXAMPLES = [
    name
    for name in NAMES
    if (name != "hoof_env.Sb3VecEnv" or find_spec("stable_baselines3")) and example_of(name).examples
]


def test_names_that_a_user_calls_have_examples():
    asked = ("load_policy", "make_policy", "stamp_onnx", "load_gait", "HorseLegVectorEnv")
    assert {f"hoof_env.{name}" for name in asked} <= set(WITH_EXAMPLES)


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_an_example_gives_what_it_says(name):
    assert not doctest.DocTestRunner().run(example_of(name)).failed
