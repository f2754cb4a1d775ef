"""The virtual environments of the suite: made once, and again where what they hold has changed."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import time
import tomllib
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from scripts.setup_venv import TORCH_INDEX

ROOT = Path(__file__).resolve().parents[2]
CACHE = ROOT / ".ecosystem"
BESIDE = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
UV = None if os.environ.get("INSTALLER") == "pip" else shutil.which("uv", path=BESIDE)
"""It installs in place of pip, several times as fast, where it is found and INSTALLER does not say pip."""


class Failed(Exception):
    """A command of the set-up did not succeed; its last words."""


@dataclass(frozen=True)
class Venv:
    """One environment of `suite.toml`.

    Attributes:
        name: of its folder under `CACHE`.
        extras: of hoof-env, which is installed from the checkout and follows its changes.
        loosen: packages whose version in constraints.txt is not asked for.
        torch: whether PyTorch is needed.
        bare: packages that are installed without what they ask for.
        wheels: projects, from `ROOT`, that are built and installed instead of the checkout; the extras go to
            the first.
        folder: where checks run and lie, from `ROOT`.
    """

    name: str
    extras: tuple[str, ...] = ()
    loosen: tuple[str, ...] = ()
    torch: bool = False
    bare: tuple[str, ...] = ()
    wheels: tuple[str, ...] = ()
    folder: str = "tests/ecosystem"

    @property
    def python(self) -> Path:
        """Its interpreter."""
        return CACHE / self.name / "bin" / "python"

    def prepare(self) -> None:
        """Make it, or bring it up to date; nothing is done where nothing has changed.

        Raises:
            Failed: a package cannot be had or does not fit its neighbours.
        """
        stamp = CACHE / self.name / "ready.stamp"
        wanted = self._stamp()
        if not (stamp.exists() and stamp.read_text() == wanted):
            started = time.monotonic()
            print(f"making .ecosystem/{self.name}", end=" ", flush=True)
            with suppress(FileNotFoundError):
                stamp.unlink()
            self._install()
            stamp.write_text(wanted)
            print(f"{time.monotonic() - started:.0f} s")
        if self.wheels:  # whatever the checkout holds now
            self._pip("--no-deps", "--force-reinstall", *map(str, self._build()))

    def _install(self) -> None:
        if not self.python.exists():
            base = getattr(sys, "_base_executable", sys.executable)
            _run(base, "-I", "-m", "venv", str(CACHE / self.name))
        if self.torch and sys.platform == "linux" and TORCH_INDEX:
            self._torch()
        self._pip("hatchling", "hatch-fancy-pypi-readme", "pytest", "filelock")
        extras = f"[{','.join(self.extras)}]"
        if self.wheels:
            first, *others = self._build()
            self._pip(f"{first}{extras}", *map(str, others))
        else:
            self._pip("--no-binary", "hoof-env", "--no-build-isolation", "--editable", f".{extras}")
        if self.bare:
            self._pip("--no-deps", *self.bare)

    def _torch(self) -> None:
        """PyTorch for the CPU. Where neither has it, it comes with the rest, perhaps with CUDA."""
        for source in ("--no-index",), ("--default-index" if UV else "--index-url", TORCH_INDEX):
            with suppress(Failed):
                return self._pip("--no-deps", "torch", *source)

    def _build(self) -> list[Path]:
        """Wheels of `wheels`, in their order."""
        built = []
        for project in self.wheels:
            folder = CACHE / "dist" / (Path(project).name or "hoof_env")
            for old in folder.glob("*.whl"):
                old.unlink()
            command = (sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder))
            _run(*command, folder=ROOT / project)
            built += folder.glob("*.whl")
        return built

    def _pip(self, *arguments: str) -> None:
        lines = (ROOT / "constraints.txt").read_text().splitlines(keepends=True)
        constraints = CACHE / f"{self.name}.constraints.txt"
        constraints.write_text("".join(line for line in lines if line.split("==")[0] not in self.loosen))
        options = ("--constraint", str(constraints), "--only-binary", ":all:", "--quiet", *arguments)
        if UV:
            _run(UV, "pip", "install", "--python", str(self.python), *options)
        else:
            _run(str(self.python), "-I", "-m", "pip", "install", "--no-input", *options)

    def _stamp(self) -> str:
        project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
        asked = [project["dependencies"], *(project["optional-dependencies"][name] for name in self.extras)]
        pins = (ROOT / "constraints.txt").read_text()
        return hashlib.sha256(repr((sys.version, self, asked, pins)).encode()).hexdigest()


def _run(*command: str, folder: Path = ROOT) -> None:
    CACHE.mkdir(exist_ok=True)
    environment = {"PIP_DISABLE_PIP_VERSION_CHECK": "1", **os.environ}
    if links := os.environ.get("PIP_FIND_LINKS"):
        environment.setdefault("UV_FIND_LINKS", ",".join(links.split()))
    done = subprocess.run(
        command, cwd=folder, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True
    )
    if done.returncode != 0:
        errors = [line for line in done.stderr.splitlines() if line.strip()] or ["it said nothing"]
        told = next((line for line in errors if line.lower().startswith("error:")), errors[-1])
        raise Failed(f"{' '.join(command[:5])} ...: {told}")
