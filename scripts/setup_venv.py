"""Make .venv and install into it what `make demo` and `make test` need; `make` runs this before either.

One line for each step, and one line that says why when something is missing. Nothing is done when nothing
has changed. An interrupted set-up is mended by the next one: the stamp is written last, and a .venv without
a stamp is made anew.

Standard library only, in a syntax that a Python too old for the project can still read.
"""

import fcntl
import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
OLDEST, NEWEST = (3, 11), (3, 13)
EXTRAS = "train,render,video,plot,export,identify,baselines,tune,onnx,dev"
NEEDED_GB = 3.0  # .venv itself takes 1.8 GB on Linux

# On Linux the usual index gives PyTorch with CUDA, which is gigabytes; this one gives 0.2 GB.
TORCH_INDEX = os.environ.get("TORCH_INDEX", "https://download.pytorch.org/whl/cpu")

UNREACHABLE = "the package index cannot be reached; check the network, or name another with PIP_INDEX_URL"
REASONS = {  # a sign in what pip or venv says: what it means. The first sign that is found is told.
    "No space left on device": "the disk is full",
    "Read-only file system": "this folder cannot be written to",
    "Permission denied": "this folder cannot be written to",
    "CERTIFICATE_VERIFY_FAILED": "the package index shows an unknown certificate; name yours with PIP_CERT",
    "NewConnectionError": UNREACHABLE,
    "NameResolutionError": UNREACHABLE,
    "ConnectTimeoutError": UNREACHABLE,
    "ProxyError": UNREACHABLE,
    "ReadTimeoutError": "the package index stopped answering; run the same command again",
    "ResolutionImpossible": "the package index lacks a version that constraints.txt names",
}


class Missing(Exception):
    """Something is missing that set-up cannot do without."""


def main() -> int:
    started = time.monotonic()
    try:
        check_python()
        with one_at_a_time():
            place, pins = wanted_stamp()
            found = read_stamp()
            if found == [place, pins]:
                return 0
            check_machine()
            install(anew=found[:1] != [place])
            stamp_path().write_text(f"{place}\n{pins}\n")
    except Missing as missing:
        print(f"set-up stopped: {missing}", file=sys.stderr)
        return 1
    except OSError as error:
        print(f"set-up stopped: {error.filename}: {error.strerror}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\nset-up interrupted; the same command takes it up again", file=sys.stderr)
        return 130
    print(f"set-up done in {time.monotonic() - started:.0f} s", flush=True)
    return 0


# What must be there


def check_python() -> None:
    if not OLDEST <= sys.version_info[:2] <= NEWEST:
        raise Missing(
            f"Python {dotted(OLDEST)} to {dotted(NEWEST)} is needed, not {dotted(sys.version_info)}"
        )


def check_machine() -> None:
    for module in ("venv", "ensurepip"):
        if importlib.util.find_spec(module) is None:
            package = f"python{dotted(sys.version_info)}-venv"
            raise Missing(f"this Python lacks its module {module}; Debian and Ubuntu have it in {package}")
    if not os.access(str(ROOT), os.W_OK):
        raise Missing(f"{ROOT} cannot be written to")
    free_gb = shutil.disk_usage(str(ROOT)).free / 1e9
    if free_gb < NEEDED_GB and not venv("").exists():
        raise Missing(f"{NEEDED_GB:.0f} GB of disk are needed in {ROOT}, and {free_gb:.1f} GB are free")


def dotted(version) -> str:
    return f"{version[0]}.{version[1]}"


@contextmanager
def one_at_a_time():
    """Let a second set-up of this checkout wait until the first is through."""
    folder = os.open(str(ROOT), os.O_RDONLY | os.O_DIRECTORY)
    try:
        with suppress(OSError):  # some network file systems cannot lock a folder
            fcntl.flock(folder, fcntl.LOCK_EX)
        yield
    finally:
        os.close(folder)


# What was installed last time


def venv(path: str) -> Path:
    return ROOT / ".venv" / path


def stamp_path() -> Path:
    return venv("set-up.stamp")


def wanted_stamp():
    """Two lines: a change in the first asks for a new .venv, a change in the second for an update."""
    inputs = (ROOT / "pyproject.toml").read_bytes() + (ROOT / "constraints.txt").read_bytes()
    return f"Python {dotted(sys.version_info)} in {ROOT}", hashlib.sha256(inputs).hexdigest()


def read_stamp():
    try:
        return stamp_path().read_text().splitlines()
    except OSError:
        return []


# The steps


def install(anew: bool) -> None:
    print(f"{'Making' if anew else 'Updating'} .venv with Python {sys.version.split()[0]}", flush=True)
    with suppress(OSError):
        stamp_path().unlink()
    if anew:
        shutil.rmtree(str(venv("")), ignore_errors=True)
        # Run by .venv's own Python, this script has just removed it: the one behind it makes the new one.
        python = getattr(sys, "_base_executable", sys.executable)
        step("virtual environment", python, "-I", "-m", "venv", ".venv")
    if sys.platform == "linux" and TORCH_INDEX:
        try:
            source = ("--index-url", TORCH_INDEX, "--retries", "1", "--timeout", "10")
            pip("PyTorch for the CPU", "--no-deps", "torch", *source)
        except Missing:
            print(f"  not from {TORCH_INDEX}; the usual index may send the CUDA build, some gigabytes")
    pip("build tool", "hatchling")
    pip("all other packages", "--no-build-isolation", "--editable", f".[{EXTRAS}]")


def pip(title: str, *arguments: str) -> None:
    options = ["--constraint", "constraints.txt", "--disable-pip-version-check", "--no-input"]
    if not os.environ.get("PYTHONDONTWRITEBYTECODE"):
        options.append("--no-compile")  # a third of the time; the first import compiles what is used
    step(title, str(venv("bin/python")), "-I", "-m", "pip", "install", *options, *arguments)


def step(title: str, *command: str) -> None:
    """Run one command and keep its output aside; a dot for each package shows that it is alive."""
    started = time.monotonic()
    print(f"  {title} ", end="", flush=True)
    environment = {"PIP_RETRIES": "3", **os.environ, "PIP_USER": "0", "LC_ALL": "C.UTF-8"}
    streams = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    process = subprocess.Popen(command, cwd=str(ROOT), env=environment, universal_newlines=True, **streams)
    said = []
    try:
        for line in process.stdout:
            said.append(line)
            if line.startswith("Collecting"):
                print(".", end="", flush=True)
    except BaseException:
        process.terminate()
        raise
    if process.wait() != 0:
        print(" failed", flush=True)
        raise Missing(why(said))
    print(f" {time.monotonic() - started:.0f} s", flush=True)


def why(said) -> str:
    """The one line that explains a failed command; all that the command said goes to a file beside it."""
    errors = [line for line in said if line.lower().startswith("error:")]
    reasons = [reason for sign, reason in REASONS.items() if any(sign in line for line in said)]
    reason = (reasons or errors or said or ["it said nothing"])[0].strip()
    with suppress(OSError):
        venv("set-up.log").write_text("".join(said))
        reason += " (more in .venv/set-up.log)"
    return reason


if __name__ == "__main__":
    sys.exit(main())
