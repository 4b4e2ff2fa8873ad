"""."""

from __future__ import annotations

import base64
import hashlib
import re
from html.parser import HTMLParser
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from sim_action.reports.escaping import plain_text
from sim_action.reports.html.document import LIVE_SCRIPT, SCRIPTS, Html, Page, element, page_script, policy, text


def hash_of(content: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()}"


def page_text() -> str:
    return Page(
        "title </title><script>",
        failed=True,
        body=[b"<main></main>"],
        index="{}",
        blocks={"a": "QQ=="},
        has_replays=True,
    ).text()


def test_what_runs_and_what_styles_is_allowed_by_its_hash() -> None:
    [script] = re.findall(r"<script>(.*?)</script>", page_text(), re.DOTALL)
    [style] = re.findall(r"<style>(.*?)</style>", page_text(), re.DOTALL)
    allowed = re.findall(r"sha256-[A-Za-z0-9+/=]+", page_text())
    assert {hash_of(script), hash_of(style)} <= set(allowed)


def test_nothing_else_may_be_done() -> None:
    told = policy("'sha256-a'", ["'sha256-b'"])
    assert told.startswith("default-src 'none'; script-src 'sha256-")
    assert "unsafe" not in told
    assert told.count("sha256-") == 2


def test_a_title_is_text() -> None:
    assert "<title>title &lt;/title&gt;&lt;script&gt;</title>" in page_text()


def test_the_script_is_made_of_all_its_parts_and_ends_no_element() -> None:
    assert "</script" not in page_script().lower()
    assert "<!--" not in page_script()
    assert len(set(SCRIPTS)) == len(SCRIPTS)


def test_every_script_beside_the_page_is_in_it() -> None:
    from importlib.resources import files

    folder = Path(str(files("sim_action.reports") / "viewer"))
    assert {file.relative_to(folder).as_posix() for file in folder.rglob("*.js")} == {*SCRIPTS, LIVE_SCRIPT}


class Seen(HTMLParser):
    """What a reader of HTML finds."""

    def __init__(self, markup: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[tuple[str, list[tuple[str, str | None]]]] = []
        self.text = ""
        self.feed(markup)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, attrs))

    def handle_data(self, data: str) -> None:
        self.text += data


@given(st.text(), st.text())
def test_whatever_text_is_it_stays_text(words: str, title: str) -> None:
    seen = Seen(element("p", words, title=title))
    assert seen.text == plain_text(words)
    assert seen.tags == [("p", [("title", plain_text(title))])]


def test_what_is_html_already_stays_so() -> None:
    assert element("p", element("b", "<"), Html("&amp;")) == "<p><b>&lt;</b>&amp;</p>"


def test_text_that_reorders_what_follows_loses_that() -> None:
    assert text("a\u202eb") == "ab"


def test_false_and_none_omit_an_attribute_and_zero_does_not() -> None:
    made = element("span", hidden=True, title=None, open=False, data_time=0.0, x=0)
    assert made == '<span hidden data-time="0.0" x="0"></span>'
