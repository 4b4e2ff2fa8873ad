"""Take the documents' pictures of report.html, docs/images/report-*.png: a burger drives into a wall.

`make screenshots`; it needs Node.js and Chromium (Debian: chromium).
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PICTURES = {"report-desktop.png": (1280, 860), "report-phone.png": (390, 844)}

SCENARIO = """\
name: burger drives straight
robot:
  model: turtlebot3_burger
world:
  objects:
    - {name: wall, box: [0.1, 2.0, 0.5], pose: {x: 1.0}}
commands:
  rate: 10 Hz
  twist:
    - {linear: 1.0}
expect:
  - travel: {at_least: 1.5 m}
  - no_collision
time_limit: 30 s
"""


def report(folder: Path) -> Path:
    """The report of a run that fails."""
    (folder / "drive_straight.sim.yml").write_text(SCENARIO, encoding="utf-8")
    environment = {name: value for name, value in os.environ.items() if not name.startswith("GITHUB_")}
    command = [sys.executable, "-m", "sim_action", "run", "."]
    subprocess.run(command, cwd=folder, env={**environment, "PYTHONPATH": str(ROOT)}, check=False, capture_output=True)
    return folder / "sim-results/report.html"


def main() -> None:
    """Takes both."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        raise SystemExit("there is neither chromium nor google-chrome to look at the report with")
    with tempfile.TemporaryDirectory() as name:
        page = report(Path(name))
        for picture, (width, height) in PICTURES.items():
            script, size = ROOT / "web/tests/screenshot.mjs", (str(width), str(height))
            subprocess.run(["node", script, page, ROOT / "docs/images" / picture, *size, browser], check=True)


if __name__ == "__main__":
    main()
