"""Make .venv and install into it what `make demo` or `make test` needs; `make` runs this before either.

    python scripts/setup_venv.py demo           what the demo needs
    python scripts/setup_venv.py                all that a checkout can use
    python scripts/setup_venv.py dependencies   what the package needs, without the package itself

One line for each step, and one line that says why when something is missing. Where PyTorch has no wheel for
this Python, the demo stops; for the rest all else is installed, and `make test` leaves out what needs it.
Nothing is done when nothing has changed. An interrupted set-up is mended by the next one: the stamp is
written last, and a .venv without a stamp is made anew. uv installs where it can be had, and otherwise pip,
which takes longer; INSTALLER=pip asks for pip. All packages are wheels of the versions in constraints.txt.

Standard library only, in a syntax that a Python too old for the project can still read.
"""

import ast
import fcntl
import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
OLDEST, NEWEST = (3, 11), (3, 14)
EXTRAS = {"demo": ("train", "render", "video", "plot")}
EXTRAS["all"] = (*EXTRAS["demo"], "export", "view", "identify", "tune", "onnx", "docs", "dev")
BARE = "dependencies"  # nothing is built or installed of the checkout; scripts/environments.py asks for it
EXTRAS[BARE] = ()
TOOLS = {
    "pip": ("pip", "install", "--disable-pip-version-check", "--no-input"),
    "uv": ("uv", "pip", "install", "--python", ".venv/bin/python"),
}
LOCKED_FILES = "pylock.toml"  # of constraints.txt, with hashes: uv checks them, INSTALLER=pip does not
NEED_TORCH = ("torch", "stable-baselines3", "sb3-contrib")  # of what pyproject.toml asks for
NO_TORCH = "all but PyTorch"  # in the stamp: a purpose that could not be met in full
ONLY_WHEELS = ("--only-binary", ":all:")
NEEDED_GB = 3.0  # .venv itself takes 1.8 GB on Linux

# On Linux the usual index gives PyTorch with CUDA, which is gigabytes; this one gives 0.2 GB.
TORCH_INDEX = os.environ.get("TORCH_INDEX", "https://download.pytorch.org/whl/cpu")

UNREACHABLE = "the package index cannot be reached; check the network, or name another with PIP_INDEX_URL"
LACKING = "the package index lacks a wheel of a version that constraints.txt names"
REASONS = {  # a sign in what pip, uv or venv says: what it means. The first sign that is found is told.
    "Failed to initialize cache": "uv cannot write its cache; set UV_CACHE_DIR to a folder, or INSTALLER=pip",
    "Hash mismatch": "the package index has another file than the one that was locked; see pylock.toml",
    "No space left on device": "the disk is full",
    "Read-only file system": "this folder cannot be written to",
    "Permission denied": "this folder cannot be written to",
    "CERTIFICATE_VERIFY_FAILED": "the package index shows an unknown certificate; name yours with PIP_CERT",
    "NewConnectionError": UNREACHABLE,
    "NameResolutionError": UNREACHABLE,
    "ConnectTimeoutError": UNREACHABLE,
    "ProxyError": UNREACHABLE,
    "ReadTimeoutError": "the package index stopped answering; run the same command again",
    "ResolutionImpossible": LACKING,
    "invalid peer certificate": "the package index shows an unknown certificate; name yours with PIP_CERT",
    "client error (Connect)": UNREACHABLE,
    "failed to lookup address": UNREACHABLE,
    "operation timed out": "the package index stopped answering; run the same command again",
    "No solution found": LACKING,
    "No matching distribution found": LACKING,
}

UV_FROM_PIP = {  # what pip is told by variables and files: uv's variable for it, and what parts a list there
    "index-url": ("UV_DEFAULT_INDEX", " "),
    "extra-index-url": ("UV_INDEX", " "),
    "find-links": ("UV_FIND_LINKS", ","),
    "no-index": ("UV_NO_INDEX", " "),
    "trusted-host": ("UV_INSECURE_HOST", " "),
    "cert": ("SSL_CERT_FILE", " "),
    "client-cert": ("SSL_CLIENT_CERT", " "),
    "proxy": ("ALL_PROXY", " "),
}


class Missing(Exception):
    """Something is missing that set-up cannot do without."""


class NoWheel(Missing):
    """PyTorch has none for this Python."""


def main(purpose: str = "all") -> int:
    started = time.monotonic()
    try:
        check_purpose(purpose)
        check_python()
        with one_at_a_time():
            place, pins = wanted_stamp()
            found = read_stamp()
            is_there = venv("bin/python").exists()  # not so once the Python behind it has gone
            enough = [purpose, "all"] + ([NO_TORCH] if purpose == "all" else [])
            if is_there and found[:2] == [place, pins] and found[2:] in [[one] for one in enough]:
                return 0
            check_machine()
            done = install(purpose, anew=not is_there or found[:1] != [place])
            stamp_path().write_text(f"{place}\n{pins}\n{done}\n")
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


def check_purpose(purpose: str) -> None:
    if purpose not in EXTRAS:
        raise Missing(f"expected {' or '.join(EXTRAS)}, got {purpose!r}")
    if os.environ.get("INSTALLER", "uv") not in TOOLS:
        raise Missing(f"INSTALLER: expected {' or '.join(TOOLS)}, got {os.environ['INSTALLER']!r}")


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
    """Two lines: a change in the first asks for a new .venv, a change in the second for an update. A third
    line has the purpose."""
    inputs = (ROOT / "pyproject.toml").read_bytes() + (ROOT / "constraints.txt").read_bytes()
    return f"Python {dotted(sys.version_info)} in {ROOT}", hashlib.sha256(inputs).hexdigest()


def read_stamp():
    try:
        return stamp_path().read_text().splitlines()
    except OSError:
        return []


# The steps


def install(purpose: str, anew: bool) -> str:
    """Install for a purpose; returns what the stamp says of it."""
    print(f"{'Making' if anew else 'Updating'} .venv with Python {sys.version.split()[0]}", flush=True)
    stamp = "\n".join([*read_stamp(), ""])
    with suppress(OSError):
        stamp_path().unlink()
    if anew:
        shutil.rmtree(str(venv("")), ignore_errors=True)
        # Run by .venv's own Python, this script has just removed it: the one behind it makes the new one.
        python = getattr(sys, "_base_executable", sys.executable)
        step("virtual environment", (python, "-I", "-m", "venv", ".venv"))
    tool = installer()
    asked, done = requirements(purpose), purpose
    try:
        if any(map(needs_torch, asked)):
            install_torch(tool)
    except NoWheel as missing:
        if purpose != "all":
            if not anew:  # nothing has changed: what was installed before still serves
                stamp_path().write_text(stamp)
            raise
        print(f"  {missing}")
        print(f"  left out: {', '.join(NEED_TORCH)}; the tests that need them will say so", flush=True)
        asked, done = [one for one in asked if not needs_torch(one)], NO_TORCH
    packages(tool, "all other packages", *ONLY_WHEELS, *asked)
    if purpose != BARE:
        packages(tool, "this checkout", "--no-deps", "--no-build-isolation", "--editable", ".")
    return done


def needs_torch(requirement: str) -> bool:
    return requirement.split(">=")[0] in NEED_TORCH


def installer() -> str:
    """A key of `TOOLS`: uv, which is put into .venv, or pip where it cannot be had or is asked for."""
    if os.environ.get("INSTALLER") == "pip":
        return "pip"
    try:
        packages("pip", "uv", *ONLY_WHEELS, "uv")
    except Missing as missing:
        print(f"  no uv here: {missing}; pip installs the same, and takes longer", flush=True)
        return "pip"
    return "uv"


def install_torch(tool: str) -> None:
    """On Linux the build for the CPU: from where pip finds links, or from TORCH_INDEX. Elsewhere the usual
    index has that one."""
    if sys.platform != "linux":
        torch_from_the_usual_index(tool, "PyTorch")
        return
    places = [("where pip finds links", "--no-index")] if "find-links" in pip_settings() else []
    if TORCH_INDEX:
        # uv would rather take UV_DEFAULT_INDEX than an --index-url
        instead = "--default-index" if tool == "uv" else "--index-url"
        places.append((TORCH_INDEX, instead, TORCH_INDEX))
    patience = () if tool == "uv" else ("--retries", "1", "--timeout", "10")
    for place, *source in places:
        with suppress(Missing):
            title = f"PyTorch from {place}"
            packages(tool, title, *ONLY_WHEELS, "--no-deps", "torch", *source, *patience, UV_HTTP_RETRIES="1")
            return
    print(
        "  what is left is the usual index: PyTorch with CUDA, some gigabytes (TORCH_INDEX=URL names another)"
    )
    torch_from_the_usual_index(tool, "PyTorch with CUDA")


def torch_from_the_usual_index(tool: str, title: str) -> None:
    try:
        packages(tool, title, *ONLY_WHEELS, "torch")
    except Missing as missing:
        words = f"PyTorch cannot be had for Python {dotted(sys.version_info)}: {missing}"
        raise (NoWheel if str(missing).startswith(LACKING) else Missing)(words) from None


def requirements(purpose: str):
    """What pyproject.toml asks for, to build this checkout too, where it is to be installed."""
    import tomllib

    asked = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    project = asked["project"]
    extras = [project["optional-dependencies"][extra] for extra in EXTRAS[purpose]]
    to_build = [] if purpose == BARE else asked["build-system"]["requires"]
    return sum(extras, to_build + project["dependencies"])


def packages(tool: str, title: str, *arguments: str, **environment: str) -> None:
    """Install into .venv within constraints.txt. The first import compiles what is used."""
    options = ["--constraint", "constraints.txt"]
    if tool == "uv" and (ROOT / LOCKED_FILES).is_file():
        options += ["--constraint", hashes()]
    if os.environ.get("PYTHONDONTWRITEBYTECODE"):  # then no import will
        options += ["--compile-bytecode"] if tool == "uv" else []
    else:
        options += ["--no-compile"] if tool == "pip" else []
    command = (str(venv("bin/python")), "-I", "-m", *TOOLS[tool], *options, *arguments)
    step(title, command, {**uv_settings(), **environment} if tool == "uv" else environment)


def hashes() -> str:
    """Path of a file that has the hashes as uv takes them for constraints: it takes no pylock.toml there, and
    installs the whole of one as requirements, whatever the purpose."""
    import tomllib

    packages = tomllib.loads((ROOT / LOCKED_FILES).read_text(encoding="utf-8"))["packages"]
    lines = [
        " ".join(
            (f"{one['name']}=={one['version']}",
             *(f"--hash=sha256:{wheel['hashes']['sha256']}" for wheel in one["wheels"]))
        )
        for one in packages
    ]  # fmt: skip
    path = venv("hashes.txt")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return str(path.relative_to(ROOT))


@lru_cache(maxsize=None)  # noqa: UP033  functools.cache is too young
def pip_settings():
    """What pip is told by variables and files, by name; the nearest counts where several say so."""
    command = (str(venv("bin/python")), "-I", "-m", "pip", "config", "list")
    told = subprocess.run(command, stdout=subprocess.PIPE, text=True).stdout.splitlines()
    settings = {}
    for scope in ("global.", "install.", ":env:."):
        for name, _, value in (line[len(scope) :].partition("=") for line in told if line.startswith(scope)):
            settings[name] = ast.literal_eval(value)
    return settings


def uv_settings():
    """The same in uv's variables."""
    settings = {"UV_INDEX_STRATEGY": "unsafe-best-match"}  # as pip: the best that any of the indexes has
    for name, value in pip_settings().items():
        if name in UV_FROM_PIP:
            variable, separator = UV_FROM_PIP[name]
            settings[variable] = separator.join(value.split())
    return {name: value for name, value in settings.items() if name not in os.environ}


def step(title: str, command, environment=()) -> None:
    """Run one command and keep its output aside; a dot for each package shows that it is alive."""
    started = time.monotonic()
    print(f"  {title} ", end="", flush=True)
    usual = {"PIP_RETRIES": "3", **os.environ, "PIP_USER": "0", "LC_ALL": "C.UTF-8"}
    streams = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    process = subprocess.Popen(
        command, cwd=str(ROOT), env={**usual, **dict(environment)}, universal_newlines=True, **streams
    )
    said = []
    try:
        for line in process.stdout:
            said.append(line)
            if line.startswith(("Collecting", " Downloaded")):  # pip's word, and uv's
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
    sys.exit(main(*sys.argv[1:]))
