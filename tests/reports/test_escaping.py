from __future__ import annotations

import sys
import unicodedata
import xml.etree.ElementTree as ET

from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from sim_action.core.wording import shortened
from sim_action.reports import escaping

# What text strategies seldom find by themselves.
NASTY = (
    *(
        "|",
        "`",
        "```",
        "\r",
        "\n",
        "\x00",
        "\x1b[31m",
        "::",
        "%0A",
        "]]>",
        "@a",
        "#1",
        "<b>",
        "\u2028",
        "##[",
        "\\",
        "_",
    ),
)
texts = st.lists(st.one_of(st.text(max_size=6), st.sampled_from(NASTY)), max_size=12).map("".join)
commonmark = MarkdownIt("commonmark").enable("table")


@given(texts)
def test_plain_text_is_well_formed_in_xml(text: str) -> None:
    element = ET.Element("a")
    element.text = escaping.plain_text(text)
    assert (ET.fromstring(ET.tostring(element)).text or "") == escaping.plain_text(text)


def test_plain_text_drops_what_xml_forbids_and_terminal_sequences() -> None:
    assert escaping.plain_text("a\x00\x08\x1f\ud800\udfff\ufffe\uffffb\tc\nd") == "ab\tc\nd"
    assert escaping.plain_text("\x1b[1;31mred\x1b[0m \x1b]0;title\x07\u202egnp.exe") == "red gnp.exe"


def test_plain_text_drops_what_cannot_be_seen_and_knows_line_ends() -> None:
    # Format characters (Cf) that have no glyph. Emoji and scripts that join letters need U+200D.
    unseen = [0xAD, 0x180E, 0x200B, 0x200C, *range(0x2060, 0x2070), 0xFEFF, *range(0xFFF9, 0xFFFC)]
    unseen += [*range(0x1BCA0, 0x1BCA4), *range(0x1D173, 0x1D17B), *range(0xE0000, 0xE0080)]
    assert escaping.plain_text("".join(f"{chr(code)}a" for code in unseen)) == "a" * len(unseen)
    visible = {*range(0x600, 0x606), 0x6DD, 0x70F, 0x890, 0x891, 0x8E2, 0x110BD, 0x110CD, *range(0x13430, 0x13456)}
    left = {code for code in range(sys.maxunicode + 1) if unicodedata.category(chr(code)) == "Cf"} - visible - {0x200D}
    assert escaping.plain_text("".join(map(chr, sorted(left)))) == ""
    assert escaping.plain_text("a\u200db") == "ab"
    for joined in ("\U0001f469\u200d\U0001f680", "\U0001f3f3\ufe0f\u200d\U0001f308", "\u0dc1\u0dca\u200d\u0dbb"):
        assert escaping.plain_text(joined) == joined
    assert escaping.plain_text("a\r\nb\rc\u2028d\x85e") == "a\nb\nc\nd\ne"


@given(texts)
def test_markdown_text_stays_in_its_cell_and_is_text(text: str) -> None:
    tokens = commonmark.parse(f"| a | b |\n| --- | --- |\n| {escaping.markdown_text(text)} | end |\n")
    cells = [token for token in tokens if token.type == "td_open"]
    inlines = [token for token in tokens if token.type == "inline"]
    assert len(cells) == 2
    assert {child.type for token in inlines for child in token.children or ()} <= {"text", "text_special"}
    assert inlines[-1].content == "end"


@given(texts)
def test_markdown_text_reads_as_it_was_written(text: str) -> None:
    tokens = commonmark.parseInline(escaping.markdown_text(text))
    read = "".join(child.content for child in tokens[0].children or ())
    assert read.replace("\u200b", "") == escaping.one_line(text).replace("\u200b", "")


def test_markdown_text_is_readable_and_notifies_nobody() -> None:
    assert escaping.markdown_text("base_link has _one_ tail_") == "base_link has &#95;one&#95; tail&#95;"
    # Markdown text notifies nobody.
    text = escaping.markdown_text("@octocat #12 http://a www.b")
    assert text == "@&#8203;octocat &#35;&#8203;12 http&#58;//a www&#46;b"


@given(texts)
def test_markdown_block_is_one_block(text: str) -> None:
    tokens = commonmark.parse(f"{escaping.markdown_block(text)}\n\nafter\n")
    assert [token.type for token in tokens] == ["fence", "paragraph_open", "inline", "paragraph_close"]


@given(texts)
def test_command_data_is_one_line_and_no_text_ends_a_command(text: str) -> None:
    assert len(f"x{escaping.command_data(text)}".splitlines()) == 1
    assert not set(escaping.command_property(text)) & set(":,\r\n")
    assert "##[" not in escaping.log_text(text, "utf-8")


def test_commands_and_logs() -> None:
    # Command data is read back by the runner.
    escaped = escaping.command_data("50 %\r\nnext%0A")
    assert escaped == "50 %25%0Anext%250A"
    # Shortened.
    assert shortened("abcdef", 6) == "abcdef"
    assert shortened("abcdefg", 6) == "abcde…"
    # Log text shows what the stream can.
    assert escaping.log_text("ä ✓", "ascii") == "\\xe4 \\u2713"
    assert escaping.log_text("ä ✓", "utf-8") == "ä ✓"


@given(texts.map(lambda text: f"%\n{text}{text}"), st.integers(min_value=1, max_value=30))
def test_shortened_command_cuts_no_escape(text: str, most: int) -> None:
    whole = escaping.command_data(text)
    cut = escaping.shortened_command(whole, most)
    assert len(cut) <= most
    if cut != whole:
        assert whole.startswith(cut[:-1])
        assert not cut[:-1].endswith(("%", "%2", "%0"))
