"""What is shipped: the wheel, the version, and an import that costs next to nothing."""

import json
import os
import re
import subprocess
import sys
import textwrap
import tomllib
import zipfile
from pathlib import Path

import pytest

import hoof_env
from hoof_env.policies.catalogue import summaries

ROOT = Path(__file__).resolve().parent.parent
HEAVY = {"llvmlite", "torch", "pygame", "matplotlib", "tyro", "stable_baselines3", "scipy"}
HEAVY |= {"importlib.metadata"}


SHIPPED = {".py", ".json", ".typed", ".in", ".md", ".html", ".css", ".js", ".j2", ".safetensors"}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dist")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    return zipfile.ZipFile(next(folder.glob("*.whl")))


def test_wheel_holds_the_package_and_nothing_else(wheel):
    shipped = {name for name in wheel.namelist() if ".dist-info/" not in name}
    sources = {path for path in (ROOT / "hoof_env").rglob("*") if path.suffix in SHIPPED}
    sources.add(ROOT / "hoof_env" / "py.typed")
    assert shipped == {path.relative_to(ROOT).as_posix() for path in sources}
    assert any(name.endswith(".json") for name in shipped)


def test_wheel_carries_licence_version_and_command(wheel):
    info = f"hoof_env-{hoof_env.__version__}.dist-info"
    metadata = wheel.read(f"{info}/METADATA").decode()
    assert f"\nVersion: {hoof_env.__version__}\n" in metadata
    assert f"{info}/licenses/LICENSE" in wheel.namelist()
    assert "hoof-env = hoof_env.cli:main" in wheel.read(f"{info}/entry_points.txt").decode()


def test_the_page_on_an_index_leads_nowhere_that_is_not_there(wheel):
    """Links and pictures of other files are left out of the README, their words stay."""
    text = wheel.read(f"hoof_env-{hoof_env.__version__}.dist-info/METADATA").decode()
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert re.search(r"!\[.*\]\(docs/", readme)
    assert "Description-Content-Type: text/markdown" in text
    assert set(re.findall(r"\]\(([^)]*)\)", text)) == set(re.findall(r"\]\((https://[^)]*)\)", readme))
    assert "[docs" not in text
    assert "](" not in text.partition("# hoof-env")[2].replace("](https://", "")
    assert "<!--" not in text
    assert "Read on\n\nGetting started | from your own project: shipped policies" in text
    assert "\n\n\n" not in text.partition("# hoof-env")[2]


def test_import_is_quick_and_loads_nothing_heavy():
    """Processor time, which a busy machine hardly changes; the first run of five may still compile bytes."""
    program = (
        "import sys, time; start = time.process_time(); import hoof_env; took = time.process_time() - start;"
        "import json; print(json.dumps([took, sorted(sys.modules)]))"
    )
    compiling = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    command = [sys.executable, "-c", program]
    runs = [subprocess.run(command, env=compiling, check=True, capture_output=True) for _ in range(5)]
    seconds, modules = zip(*(json.loads(run.stdout) for run in runs), strict=True)
    assert not HEAVY.intersection(modules[0])
    assert min(seconds) < 0.5


def test_every_dependency_has_a_tested_version():
    """And the tested version lies within the bounds that pyproject.toml gives."""
    from packaging.requirements import Requirement
    from packaging.utils import canonicalize_name

    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pins = [Requirement(line) for line in lines if line and not line.startswith("#")]
    tested = {canonicalize_name(pin.name): str(pin.specifier).removeprefix("==") for pin in pins}
    assert len(tested) == len(pins)
    assert all(re.fullmatch(r"[0-9.]+(b\d+)?", version) for version in tested.values()), "no +cpu, no bounds"

    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    asked = project["build-system"]["requires"] + project["project"]["dependencies"]
    for extra in project["project"]["optional-dependencies"].values():
        asked += extra
    for requirement in map(Requirement, asked):
        assert requirement.specifier.contains(tested[canonicalize_name(requirement.name)]), requirement


def test_the_wheel_alone_lists_and_plays_what_ships(wheel, tmp_path):
    """Without a checkout and without a learning library."""
    wheel.extractall(tmp_path / "site")
    program = (
        "import sys, hoof_env; from hoof_env import cli; assert cli.main(['list']) == 0;"
        "policy = hoof_env.load_policy('hoof_env/Horse-v0');"
        "print(policy.path, policy.predict([[0.0] * 66] * 2)[0].shape);"
        "print(sorted({'agents', 'torch', 'stable_baselines3', 'onnxruntime'} & {*sys.modules}))"
    )
    env = os.environ | {"PYTHONPATH": str(tmp_path / "site")}
    run = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, env=env, capture_output=True, text=True
    )
    assert run.returncode == 0, run.stderr
    *listed, shape, loaded = run.stdout.splitlines()
    assert [line.partition(":")[0] for line in listed if line.startswith("hoof_env/")] == list(summaries())
    assert shape == f"{tmp_path / 'site/hoof_env/data/policies/Horse-v0'} (2, 16)"
    assert loaded == "[]"


USER = """
    import math
    import hoof_env

    PAY = 1.0

    def helper(x):
        return 2.0 * x

    def made(factor):
        def mine(step, weight):
            return factor * weight * PAY * helper(step.seconds)
        return mine

    for name, factor in (("A", 1.0), ("B", 10.0)):
        term = hoof_env.Term("mine", 1.0, "-", "a test's", made(factor))
        hoof_env.register(f"own/{name}-v0", terms=[term])
"""

CALL = """
    import gc, sys
    import hoof_env
    from pathlib import Path
    import gymnasium as gym, numpy as np
    from hoof_env.simd.compile import COMPILED

    def megabytes():
        file = Path("/proc/self/smaps_rollup")
        rows = dict(row.split(maxsplit=1) for row in file.read_text().splitlines()) if file.exists() else {}
        return float(rows.get("Rss:", "0 kB").split()[0]) / 1e3

    print(hoof_env.__file__)
    for id in sys.argv[1:]:
        before = megabytes()
        env = gym.make(f"mine:own/{id}-v0")
        env.reset(seed=0)
        reward = env.step(np.zeros(4, np.float32))[4]["reward_mine"]
        del env
        gc.collect()
        print(reward, megabytes() - before, *sorted(set(COMPILED)))
        COMPILED.clear()
"""


def test_an_edit_of_the_users_file_compiles_anew_and_nothing_else_does(wheel, tmp_path):
    """In another project's folder, with the package from the wheel, and nothing compiled before. Two ids,
    whose functions have one name, keep a kernel each, whichever has it after an edit. The second takes a few
    MB, most of them for LLVM to work in."""
    site = tmp_path / "site"
    wheel.extractall(site)

    def rewards(*ids):
        environment = {
            **os.environ, "HOOF_ENV_CACHE_DIR": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1",
            "PYTHONPATH": os.pathsep.join([str(tmp_path), str(site)]),
        }  # fmt: skip
        command = [sys.executable, "-c", textwrap.dedent(CALL), *ids]
        done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        package, *lines = done.stdout.splitlines()
        assert Path(package).is_relative_to(site)
        rows = [line.split() for line in lines]
        grown.append(float(rows[-1][1]))
        return [(round(float(paid), 9), compiled) for paid, _, *compiled in rows]

    grown = []
    every = ["observe_one", "start_leg", "step_one"]
    (tmp_path / "mine.py").write_text(textwrap.dedent(USER))
    assert rewards("A", "B") == [(0.04, every), (0.4, ["step_one"])]
    assert grown[0] < 12
    assert rewards("A", "B") == [(0.04, []), (0.4, [])]
    exchanged = USER.replace('("A", 1.0), ("B", 10.0)', '("A", 10.0), ("B", 1.0)')
    assert exchanged != USER
    (tmp_path / "mine.py").write_text(textwrap.dedent(exchanged))
    assert rewards("A", "B") == [(0.4, []), (0.04, [])]
    edited = USER.replace("PAY = 1.0", "PAY = 3.0").replace("2.0 * x", "5.0 * x")
    (tmp_path / "mine.py").write_text(textwrap.dedent(edited))
    assert rewards("A") == [(0.3, ["step_one"])]
