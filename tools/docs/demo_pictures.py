"""Take the pictures in examples/demo/images: the views of a reviewer after examples/demo/turn-red.patch.

`make demo-pictures`; it needs Node.js, Chromium and a font with emoji (Debian: chromium, fonts-noto-color-emoji). The
charts of the summary need Mermaid: the environment variable MERMAID names the `dist/mermaid.min.js` of its npm package.
"""

from __future__ import annotations

import html
import os
import platform
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from markdown_it import MarkdownIt
from PIL import Image

from tests.integration.github import Annotation, WorkflowResult, run_workflow
from tools.docs.picture import CHARTS, STYLE

ROOT: Final = Path(__file__).resolve().parents[2]
DEMO: Final = ROOT / "examples/demo"
WORKFLOW: Final = ".github/workflows/simulation.yml"

# Similar to the annotation below a line on GitHub's page "Files changed".
ANNOTATION_STYLE: Final = """
.file { border: 1px solid #d1d9e0; border-radius: 6px; overflow: hidden }
.file > header { background: #f6f8fa; border-bottom: 1px solid #d1d9e0; padding: 8px 12px }
pre { font: 12px/20px ui-monospace, "DejaVu Sans Mono", monospace; margin: 0; white-space: pre-wrap }
pre b { color: #59636e; display: inline-block; font-weight: normal; padding-right: 16px; text-align: right; width: 3ch }
.note { border: 1px solid #d1d9e0; border-left: 4px solid #d1242f; border-radius: 6px; margin: 8px 16px }
.note { padding: 8px 12px }
.note p { margin: 0 } .note .from { color: #59636e; font-size: 12px }
"""


@contextmanager
def red_run() -> Iterator[tuple[Path, WorkflowResult]]:
    """Yield the demo as a repository with the patch, and the result of its workflow on a pull request."""
    with tempfile.TemporaryDirectory() as name:
        repository = Path(name, "scout")
        shutil.copytree(DEMO, repository, ignore=shutil.ignore_patterns("sim-results", "__pycache__"))
        for command in (["init", "--quiet"], ["apply", "turn-red.patch"]):
            subprocess.run(["git", *command], cwd=repository, check=True)
        event = "pull_request"
        yield repository, run_workflow(repository / WORKFLOW, repository, temp=Path(name, "run"), event_name=event)


def summary_page(markdown: str) -> str:
    """Return a page with the job summary, similar to GitHub's."""
    # The kernel of this machine is of no interest.
    neutral = markdown.replace(platform.platform(), platform.system())
    body: str = MarkdownIt("commonmark", {"html": True}).enable("table").render(neutral)
    if library := os.environ.get("MERMAID"):
        body += f"<script src='{Path(library).resolve().as_uri()}'></script><script>{CHARTS}</script>"
    return body


def annotation_page(annotation: Annotation, source: str) -> str:
    """Return a page with some lines of a file and an annotation below its line, similar to GitHub's."""
    lines, line = source.splitlines(), annotation.line or 1
    shown = range(max(1, line - 3), min(len(lines), line + 2) + 1)
    rows = [f"<pre><b>{number}</b>{html.escape(lines[number - 1])}</pre>" for number in shown]
    where = f"Check failure on line {line} in {annotation.file}"
    message = html.escape(annotation.message).replace("\n", "<br>")
    note = f'<div class="note"><p class="from">{html.escape(where)}</p><p>{message}</p></div>'
    rows.insert(shown.index(line) + 1, note)
    return f'<div class="file"><header>{html.escape(str(annotation.file))}</header>{"".join(rows)}</div>'


def take(page: Path, picture: str, size: tuple[int, int], colours: str, selector: str) -> None:
    """Write a picture of a page that shows the element `selector`; `size`: width and height in pixels."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        raise SystemExit("there is neither chromium nor google-chrome to take pictures with")
    script, target = ROOT / "tools/viewer/tests/screenshot.mjs", DEMO / "images" / picture
    subprocess.run(["node", script, page, target, *map(str, size), browser, colours, selector], check=True)
    # 256 colours are enough for these pages, and a third of the size.
    with Image.open(target) as image:
        smaller = image.convert("RGB").quantize(256, dither=Image.Dither.NONE)
    smaller.save(target, optimize=True)


def main() -> None:
    """Run the demo with its patch and take all pictures."""
    (DEMO / "images").mkdir(exist_ok=True)
    with red_run() as (repository, result):
        [annotation] = [note for note in result.jobs["simulation"].annotations if note.level == "error"]
        pages = {
            "summary": summary_page(result.jobs["simulation"].summary),
            "annotation": annotation_page(annotation, (repository / str(annotation.file)).read_text(encoding="utf-8")),
        }
        for name, body in pages.items():
            head = f'<!doctype html><meta charset="utf-8"><style>{STYLE}{ANNOTATION_STYLE}</style>'
            (repository / f"{name}.html").write_text(head + body, encoding="utf-8")
        drawn = "svg" if os.environ.get("MERMAID") else "h2"
        report = result.artifacts / "report.html/report.html"
        live = ".scenario.live .view canvas[data-kind]"
        take(repository / "summary.html", "summary.png", (1040, 945), "light", drawn)
        take(repository / "annotation.html", "annotation.png", (900, 300), "light", ".note")
        take(report, "report-light.png", (1280, 860), "light", live)
        take(report, "report-dark.png", (1280, 860), "dark", live)
        take(report, "report-phone.png", (390, 844), "light", live)


if __name__ == "__main__":
    main()
