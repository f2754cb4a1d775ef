"""Fill the marked blocks of the pages of docs/environments.

python -m docs._manual          write the pages
python -m docs._manual --check  name the pages that are out of date; exit code 1 if there are any
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from docs._manual.blocks import PAGES, filled
from hoof_env.errors import HoofEnvError


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code."""
    options = sys.argv[1:] if arguments is None else list(arguments)
    if options not in ([], ["--check"]):
        print(f"usage: python -m docs._manual [--check]; got {' '.join(options)}", file=sys.stderr)
        return 2
    stale = []
    for path in sorted(PAGES.glob("*.md")):
        page = path.read_text(encoding="utf-8")
        try:
            now = filled(page)
        except HoofEnvError as error:
            print(f"{path.name}: {error}", file=sys.stderr)
            return 2
        if now != page:
            stale.append(path)
            if not options:
                path.write_text(now, encoding="utf-8")
    for path in stale:
        print(f"{path.name}: {'out of date; run `python -m docs._manual`' if options else 'written'}")
    return 1 if options and stale else 0


if __name__ == "__main__":
    sys.exit(main())
