from __future__ import annotations

from html.parser import HTMLParser

from hypothesis import given
from hypothesis import strategies as st

from sim_action.reports.escaping import plain_text
from sim_action.reports.page.markup import Html, element, joined, text


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


def test_attributes_without_a_value_and_without_being_there() -> None:
    assert element("p", hidden=True, open=False, id=None, class_="a", aria_label="b") == (
        '<p hidden class="a" aria-label="b"></p>'
    )


def test_some_elements_have_no_end() -> None:
    assert element("meta", charset="utf-8") == '<meta charset="utf-8">'


def test_text_that_reorders_what_follows_loses_that() -> None:
    assert text("a\u202eb") == "ab"


def test_empty_parts_leave_no_line() -> None:
    assert joined("a", "", Html("<b>")) == "a\n<b>"
