"""The report for notebooks: styles that any theme can have around them, and no markup from a text."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from sim_action.reports import display
from sim_action.reports.html.notebook import _STYLES, HtmlConsole, outcome_page, player_frame, report_frame
from tests.outcomes import like, outcome, report_options
from tests.replays import drive, kept

MIN_CONTRAST = 3.5
THEMES = ["#ffffff", "#111111", "#1e1e1e"]


def luminance(colour: str) -> float:
    """The relative luminance of WCAG 2."""
    parts = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    red, green, blue = (part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def test_each_style_of_the_terminal_has_one_here() -> None:
    assert _STYLES.keys() == display._CODES.keys()


@pytest.mark.parametrize("theme", THEMES)
def test_colours_are_readable_in_light_and_dark_themes(theme: str) -> None:
    colours = re.findall(r"color: (#\w{6})", " ".join(_STYLES.values()))
    assert len(colours) == 6
    for colour in colours:
        darker, lighter = sorted((luminance(theme), luminance(colour)))
        assert (lighter + 0.05) / (darker + 0.05) > MIN_CONTRAST


def test_lines_in_a_notebook() -> None:
    # Lines are indented and text is no markup.
    shown = HtmlConsole()
    shown.print(("  ", ""), ("✓ ", "green"), ("<b>", ""))
    shown.print(("", ""))
    html = shown.html()
    assert 'padding-left: 4ch; text-indent: -2ch"><span style="color: #23873e' in html
    assert html.endswith("✓ </span>&lt;b&gt;</div></div>")
    # Empty lines are shown between others.
    shown = HtmlConsole()
    for text in ("a", "b"):
        shown.print(("", ""), (text, ""))
        shown.print(("", ""))
    assert shown.html().count("<br>") == 1


@pytest.mark.parametrize("frame", [report_frame, player_frame])
def test_a_page_stays_in_its_frame(frame: Callable[[str], str]) -> None:
    assert frame('<p title="x">').endswith('srcdoc="&lt;p title=&quot;x&quot;&gt;"></iframe>')


def test_a_run_of_a_gate_is_shown_alone(tmp_path: Path) -> None:
    replay = kept(drive(), tmp_path, "cart")
    ran = like(outcome("cart.sim.yml"), replay=replay, gate="often", group="cart")
    made = outcome_page(ran, report_options(tmp_path))
    assert made is not None
    text = made.text()
    assert '<html lang="en" data-embed>' in text
    assert text.count("<article") == 1
    assert "<nav" not in text
    # A run without a replay has no page.
    for name in (None, "replays/lost.json.gz", "../cart.json.gz"):
        assert outcome_page(outcome("a.sim.yml", replay=name), report_options(tmp_path)) is None
