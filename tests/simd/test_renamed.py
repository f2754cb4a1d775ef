"""Names that modules had once are refused with what to write now."""

import pytest

from hoof_env import simd
from hoof_env.simd import compile as compile_module


def test_an_old_name_is_refused_with_the_new_one():
    with pytest.raises(ImportError, match=r"hoof_env\.simd\.choose is called where now"):
        from hoof_env.simd import choose  # noqa: F401
    with pytest.raises(ImportError, match=r"hoof_env\.simd\.rows is called new_rows now"):
        from hoof_env.simd import rows  # noqa: F401


@pytest.mark.parametrize("name", ["inline_llvm", "inline_source", "inlined", "pasted"])
def test_decorators_that_are_gone_are_refused_with_what_to_do(name):
    with pytest.raises(ImportError, match=rf"compile\.{name} is gone: leave the decorator out"):
        exec(f"from hoof_env.simd.compile import {name}")


def test_other_names_are_unknown_as_in_any_module():
    assert not hasattr(simd, "nothing")
    assert not hasattr(compile_module, "nothing")
    with pytest.raises(ImportError, match="cannot import name 'nothing'"):
        from hoof_env.simd import nothing  # noqa: F401
