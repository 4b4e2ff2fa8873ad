"""Draws docs/terminal.svg, the README's picture: two real runs, one of which fails. `make picture`."""

from __future__ import annotations

import io
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from rich.console import Console
from rich.terminal_theme import DIMMED_MONOKAI
from rich.text import Text

ROOT = Path(__file__).resolve().parent.parent
TARGET = ROOT / "docs/terminal.svg"
COLUMNS = 96

PASSING = (ROOT / "examples/turtlebot3/straight_line.sim.yml").read_text(encoding="utf-8")
FAILING = """\
name: burger turns before the wall
robot: {model: turtlebot3_burger}
world:
  objects:
    - {name: wall, box: [0.1, 2.0, 0.5], pose: {x: 1.5}}
commands:
  twist: [{linear: 0.5, for: 4 s}, {linear: 0.3, angular: 45 deg/s}]
expect:
  - no_collision
  - upright: {max_tilt: 10 deg}
duration: 6 s
time_limit: 10 s
"""


def terminal_output() -> str:
    """What `sim-action run` prints of both, in colour."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name, "simulation")
        folder.mkdir()
        (folder / "straight_line.sim.yml").write_text(PASSING, encoding="utf-8")
        (folder / "wall.sim.yml").write_text(FAILING, encoding="utf-8")
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "FORCE_COLOR": "1", "COLUMNS": str(COLUMNS)}
        ran = subprocess.run(
            [sys.executable, "-m", "sim_action", "run", "simulation"],
            cwd=name,
            env=environment,
            stdout=subprocess.PIPE,
            text=True,
            check=False,
        )
    return f"$ sim-action run simulation\n{ran.stdout}"


def main() -> None:
    """Writes the picture."""
    console = Console(record=True, width=COLUMNS, file=io.StringIO(), force_terminal=True)
    console.print(Text.from_ansi(terminal_output()))
    svg = console.export_svg(title="sim-action", theme=DIMMED_MONOKAI, unique_id="terminal")
    # The fonts would be fetched from elsewhere by whoever looks at it.
    svg = svg.replace(" https://www.textualize.io", "")
    svg = re.sub(r"@font-face \{.*?\}\s*", "", svg, flags=re.DOTALL).replace("Fira Code", "ui-monospace")
    TARGET.write_text(svg, encoding="utf-8")
    print(f"wrote {TARGET.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
