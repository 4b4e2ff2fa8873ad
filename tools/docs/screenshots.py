"""Take the documents' pictures of report.html, docs/images/report-*.png: one that drives into a wall, and a suite.

`make screenshots`; it needs Node.js and Chromium (Debian: chromium).
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
LIVE = ".scenario.live .view canvas[data-kind]"
ONE = {"report-desktop.png": (1280, 860), "report-phone.png": (390, 844)}
OF_SUITE = {
    "report-suite.png": ("#suite.open", ""),
    "report-ghost.png": (".against .swatch:not([hidden])", "#scenario=past%20the%20pillar&t=3&against=base%20run"),
    "report-sweep.png": (".points .run-point", "#scenario=stops%20before%20the%20dock"),
}

SUITE = """\
robot: {{model: turtlebot3_burger}}
commands: {{rate: 10 Hz, twist: [{{linear: 0.4, angular: {turn}}}]}}
duration: 8 s
time_limit: 9 s
scenarios:
  - name: along the corridor
    tags: [corridor]
    expect: [{{travel: {{at_least: 1.5 m}}}}, upright]
  - name: past the pillar
    tags: [corridor]
    world: {{objects: [{{name: pillar, cylinder: {{radius: 0.15, height: 1}}, pose: {{x: 1.6, y: 0.5}}}}]}}
    expect: [{{travel: {{at_least: 2 m}}}}, no_collision]
  - name: through the gap
    tags: [corridor, narrow]
    world:
      objects:
        - {{name: left, box: [0.4, 0.4, 0.5], pose: {{x: 1.2, y: 0.42}}}}
        - {{name: right, box: [0.4, 0.4, 0.5], pose: {{x: 1.2, y: -0.42}}}}
    expect: [{{travel: {{at_least: 2 m}}}}, no_collision]
  - name: round the pillar
    tags: [corridor]
    robot: {{model: turtlebot3_burger, pose: {{y: -0.1}}}}
    world: {{objects: [{{name: pillar, cylinder: {{radius: 0.15, height: 1}}, pose: {{x: 1.6, y: 0.5}}}}]}}
    expect: [{{travel: {{at_least: 2 m}}}}, {{clearance: {{at_least: 20 cm}}}}]
  - name: behind the shelf
    tags: [narrow]
    world: {{objects: [{{name: shelf, box: [2.0, 0.3, 0.8], pose: {{x: 2.0, y: -0.9}}}}]}}
    expect: [{{travel: {{at_least: 2 m}}}}, {{clearance: {{at_least: 10 cm}}}}]
  - name: to the charger
    tags: [dock]
    expect: [{{travel: {{at_least: 2.5 m}}}}, {{max_speed: {{linear: 0.6 m/s}}}}]
  - name: slow and level
    expect: [{{max_speed: {{linear: 0.6 m/s}}}}, upright]
  - name: stops before the dock
    tags: [dock]
    world: {{objects: [{{name: dock, box: [0.3, 1.5, 0.4], pose: {{x: 3.4}}}}]}}
    variations:
      commands.twist.0.linear: [0.2, 0.3, 0.35, 0.4, 0.45]
      commands.twist.0.angular: [-0.1, 0.0, 0.1]
    expect: [{{travel: {{at_least: 1 m}}}}, no_collision]
"""

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


def ran(folder: Path, name: str, *arguments: str) -> Path:
    """The report of a call on the files of a folder."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith("GITHUB_")}
    command = [sys.executable, "-m", "sim_action", "run", ".", "--output-dir", name, *arguments]
    subprocess.run(command, cwd=folder, env={**environment, "PYTHONPATH": str(ROOT)}, check=False, capture_output=True)
    return folder / name / "report.html"


def compared(folder: Path) -> Path:
    """Run several scenarios twice, and return the report that compares both runs."""
    for name, turn in (("base", 0.0), ("now", 0.12)):
        (folder / "corridor.sim.yml").write_text(SUITE.format(turn=turn), encoding="utf-8")
        page = ran(folder, name)
    command = [sys.executable, "-m", "sim_action", "report", "now", "--against", "base/results.json"]
    subprocess.run(command, cwd=folder, env={**os.environ, "PYTHONPATH": str(ROOT)}, check=False, capture_output=True)
    return page


def main() -> None:
    """Take all pictures in light colours, or in the colours of the argument: `light` or `dark`."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        raise SystemExit("there is neither chromium nor google-chrome to look at the report with")
    colours = sys.argv[1] if len(sys.argv) > 1 else "light"

    def take(page: Path, picture: str, size: tuple[int, int], *seen: str) -> None:
        path = ROOT / "docs/images" / picture
        script = ROOT / "tools/viewer/tests/screenshot.mjs"
        subprocess.run(["node", script, page, path, *map(str, size), browser, colours, *seen], check=True)
        # A third of the size, and no difference to be seen.
        Image.open(path).convert("RGB").quantize(256).save(path, optimize=True)

    with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as several:
        (Path(one) / "drive_straight.sim.yml").write_text(SCENARIO, encoding="utf-8")
        page = ran(Path(one), "sim-results")
        for picture, size in ONE.items():
            take(page, picture, size, LIVE)
        page = compared(Path(several))
        for picture, seen in OF_SUITE.items():
            take(page, picture, (1280, 860), *seen)


if __name__ == "__main__":
    main()
