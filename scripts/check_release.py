"""Fail unless all that a release needs is filled in: `publish.yml` runs this before it uploads anything.

    python scripts/check_release.py

It uses the standard library alone, as the workflow installs nothing for it. CITATION.cff is read by the line:
the entries in question are one line each.
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def unfilled(root: Path = ROOT) -> list[str]:
    """Return the places that are still to be filled in; addresses that disagree, too."""
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = (root / "CITATION.cff").read_text(encoding="utf-8")
    cited = re.search(r"^repository-code:[ \t]*['\"]?([^'\"\s]+)", citation, re.MULTILINE)
    places = {
        "pyproject.toml: [project.urls] Repository": project.get("urls", {}).get("Repository", ""),
        "CITATION.cff: repository-code": cited[1] if cited else "",
        "pyproject.toml: [project] authors, e-mail": _email(project),
    }
    found = [place for place, value in places.items() if not value]
    addresses = {value for place, value in places.items() if value and "e-mail" not in place}
    if len(addresses) > 1:
        found.append(f"one address of the repository, got {' and '.join(sorted(addresses))}")
    return found


def _email(project: dict[str, list[dict[str, str]]]) -> str:
    """Return the address of the first author with one, empty if there is none."""
    return next((one["email"] for one in project.get("authors", []) if one.get("email")), "")


def main() -> int:
    """Print the places that are unfilled; return 1 if there are any."""
    found = unfilled()
    for place in found:
        print(f"to fill in before a release: {place}", file=sys.stderr)
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
