"""Draw the documents' pictures of two real runs, one of which fails: docs/images/terminal.svg and summary.png.

`make picture`; the second needs Chromium, a font with emoji (Debian: chromium, fonts-noto-color-emoji), and for its
charts Mermaid: the environment variable MERMAID names the `dist/mermaid.min.js` of its npm package.
"""

from __future__ import annotations

import io
import os
import platform
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from markdown_it import MarkdownIt
from rich.console import Console
from rich.terminal_theme import DIMMED_MONOKAI
from rich.text import Text

ROOT = Path(__file__).resolve().parents[2]
TERMINAL = ROOT / "docs/images/terminal.svg"
SUMMARY = ROOT / "docs/images/summary.png"
COLUMNS = 96
WINDOW = "1040,1010"

PASSING = (ROOT / "examples/turtlebot3/straight_line.sim.yml").read_text(encoding="utf-8")
FAILING = """\
name: burger keeps away from the wall
robot: {model: turtlebot3_burger}
world:
  objects:
    - {name: wall, box: [0.1, 2.0, 0.5], pose: {x: 1.5}}
commands:
  twist: [{linear: 0.5, for: 4 s}, {linear: 0.3, angular: 45 deg/s}]
expect:
  - clearance: {at_least: 30 cm}
  - upright: {max_tilt: 10 deg}
duration: 6 s
time_limit: 10 s
"""


# Near enough to how GitHub shows a job summary.
STYLE = """
body { font: 14px/1.5 -apple-system, "Segoe UI", "Noto Sans", "DejaVu Sans", sans-serif; margin: 24px; color: #1f2328 }
h2 { border-bottom: 1px solid #d1d9e0; padding-bottom: 6px } h2, h3 { margin: 20px 0 12px }
table { border-collapse: collapse; margin: 12px 0 } th, td { border: 1px solid #d1d9e0; padding: 5px 12px }
tr:nth-child(2n) { background: #f6f8fa } a { color: #0969da; text-decoration: none } details { margin: 8px 0 }
code { font: 85% ui-monospace, "DejaVu Sans Mono", monospace; background: #818b981f; padding: 2px 5px }
sub { line-height: 0; font-size: 85%; vertical-align: baseline }
"""

# As GitHub does: what a fence says is for Mermaid becomes a picture.
CHARTS = """
mermaid.initialize({startOnLoad: false, securityLevel: "strict"});
document.querySelectorAll("code.language-mermaid").forEach(async (chart, number) => {
  const {svg} = await mermaid.render(`chart${number}`, chart.textContent);
  chart.parentElement.outerHTML = `<div>${svg}</div>`;
});
"""


def run() -> tuple[str, str]:
    """Return the coloured output of `sim-action run` and its job summary."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name, "simulation")
        folder.mkdir()
        (folder / "straight_line.sim.yml").write_text(PASSING, encoding="utf-8")
        (folder / "wall.sim.yml").write_text(FAILING, encoding="utf-8")
        summary = Path(name, "summary.md")
        environment = {
            **os.environ,
            "PYTHONPATH": str(ROOT),
            "FORCE_COLOR": "1",
            "COLUMNS": str(COLUMNS),
            "GITHUB_STEP_SUMMARY": str(summary),
            "GITHUB_SERVER_URL": "https://github.com",
            "GITHUB_REPOSITORY": "you/robot",
            "GITHUB_SHA": "main",
        }
        ran = subprocess.run(
            [sys.executable, "-m", "sim_action", "run", "simulation"],
            cwd=name,
            env=environment,
            stdout=subprocess.PIPE,
            text=True,
            check=False,
        )
        # Which kernel this machine has is of no use to anybody.
        text = summary.read_text(encoding="utf-8").replace(platform.platform(), platform.system())
        return f"$ sim-action run simulation\n{ran.stdout}", text


def draw_terminal(output: str) -> None:
    """Writes the picture of the terminal."""
    console = Console(record=True, width=COLUMNS, file=io.StringIO(), force_terminal=True)
    console.print(Text.from_ansi(output))
    svg = console.export_svg(title="sim-action", theme=DIMMED_MONOKAI, unique_id="terminal")
    # The fonts would be fetched from elsewhere by every reader.
    svg = svg.replace(" https://www.textualize.io", "")
    svg = re.sub(r"@font-face \{.*?\}\s*", "", svg, flags=re.DOTALL).replace("Fira Code", "ui-monospace")
    TERMINAL.write_text(svg, encoding="utf-8")


def draw_summary(markdown: str) -> None:
    """Writes the picture of the job summary."""
    library = os.environ.get("MERMAID")
    if library is None:
        raise SystemExit("the charts need Mermaid: set MERMAID to the dist/mermaid.min.js of its npm package")
    body = MarkdownIt("commonmark", {"html": True}).enable("table").render(markdown)
    body += f"<script src='{Path(library).resolve().as_uri()}'></script><script>{CHARTS}</script>"
    with tempfile.TemporaryDirectory() as name:
        page = Path(name, "summary.html")
        page.write_text(f'<!doctype html><meta charset="utf-8"><style>{STYLE}</style>{body}', encoding="utf-8")
        options = ("--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--force-device-scale-factor=1")
        # Charts take their time.
        patient = "--virtual-time-budget=10000"
        where = (f"--user-data-dir={name}/profile", f"--window-size={WINDOW}", f"--screenshot={SUMMARY}")
        subprocess.run(["chromium", *options, patient, *where, page.as_uri()], check=True, capture_output=True)


def main() -> None:
    """Writes both pictures."""
    terminal, summary = run()
    draw_terminal(terminal)
    draw_summary(summary)


if __name__ == "__main__":
    main()
