"""Writes findings/README.md from the first lines of the scripts beside it: `python -m tools.findings [--check]`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

FOLDER: Final = Path(__file__).parents[1] / "findings"
PAGE: Final = FOLDER / "README.md"
_HEAD: Final = """\
# Findings

Behaviour of libraries, formats and tools of this field that a good guess gets wrong, and that is no fault of
sim-action. Each script installs pinned public packages in a temporary folder, runs them without sim-action, prints what
it sees, and fails if that is no longer what its first comment states. Its comment also says what one would guess, and
for whom it matters.

Run all with `make findings`, or some with `make findings ONLY="NAME NAME"`. No test and no CI job runs them. This page
is generated: `python -m tools.findings`.

| finding | packages | what happens |
| --- | --- | --- |
"""


def page() -> str:
    """Return the text of the page: a row for each script, in the order of their names."""
    return _HEAD + "".join(f"{_row(script)}\n" for script in sorted(FOLDER.glob("*.sh")))


def _row(script: Path) -> str:
    _, title, _, packages, *_ = script.read_text(encoding="utf-8").splitlines()
    cells = (f"[{script.stem}]({script.name})", packages.removeprefix("# Packages: "), title.removeprefix("# "))
    return f"| {' | '.join(cell.replace('|', '&#124;') for cell in cells)} |"


def main() -> None:
    """Write the page, or with `--check` end with 1 if it is not up to date."""
    if sys.argv[1:] == ["--check"]:
        if PAGE.read_text(encoding="utf-8") != page():
            sys.exit("findings/README.md is not up to date: run python -m tools.findings")
    else:
        PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
