"""Escape untrusted text of scenarios, models and scripts for terminals, Markdown, XML and workflow commands."""

from __future__ import annotations

import re
from typing import Final

# CSI and OSC sequences of ECMA-48: they colour the terminal, move its cursor or set its title.
_TERMINAL_SEQUENCE: Final = re.compile(r"\x1b(?:\[[0-?]*[ -/]*[@-~]|\][^\x07\x1b]*(?:\x07|\x1b\\))")
_LINE_END: Final = re.compile(r"\r\n|[\r\v\f\x1c-\x1e\x85\u2028\u2029]")
# Control characters except tab and newline, bidirectional controls (Unicode annex 9), other format characters that are
# invisible, surrogates, U+FFFE and U+FFFF.
_UNWANTED: Final = re.compile(
    r"[\x00-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u180e\u200b\u200c\u200e\u200f\u202a-\u202e\u2060-\u206f\ud800-\udfff"
    r"\ufeff\ufff9-\ufffb\ufffe\uffff\U0001bca0-\U0001bca3\U0001d173-\U0001d17a\U000e0000-\U000e007f]"
)
_USELESS_JOINER: Final = re.compile(r"(?<![^\x00-\x7f])\u200d+")  # emoji and some scripts need this joiner
# Character references instead of backslashes, because they also work in the HTML inside Markdown.
_MARKDOWN: Final = str.maketrans({character: f"&#{ord(character)};" for character in "|*`[]\\~$"}) | str.maketrans(
    {
        "&": "&amp;",
        "<": "&lt;",
        ">": "&gt;",
        # GitHub searches for mentions and references after rendering; a zero-width space prevents a match.
        "@": "@&#8203;",
        "#": "&#35;&#8203;",
    }
)
# An underscore between letters or digits is not markup, and is common in names, so it stays.
_MARKUP_UNDERSCORE: Final = re.compile(r"(?<![A-Za-z0-9])_|_(?![A-Za-z0-9])")
_PARTIAL_ESCAPE: Final = re.compile(r"%.?\Z")
_LEGACY_COMMAND: Final = re.compile(r"##(?=\[)")


def plain_text(text: str) -> str:
    """Return text with newlines, without terminal sequences and characters that are invisible or not in XML 1.0."""
    if text.isascii() and text.isprintable():
        return text
    return _USELESS_JOINER.sub("", _UNWANTED.sub("", _LINE_END.sub("\n", _TERMINAL_SEQUENCE.sub("", text))))


def one_line(text: str) -> str:
    """Return plain text on one line, with single spaces for all white space."""
    return " ".join(plain_text(text).split())


def markdown_text(text: str) -> str:
    """Return text for one line of Markdown, HTML or a table cell, without any effective markup, link or mention."""
    escaped = _MARKUP_UNDERSCORE.sub("&#95;", one_line(text).translate(_MARKDOWN))
    return escaped.replace("://", "&#58;//").replace("www.", "www&#46;")


def markdown_block(text: str, language: str = "text") -> str:
    """Return text as a fenced code block; the fence is longer than any run of backticks in the text."""
    plain = plain_text(text).strip("\n")
    longest = max((len(run) for run in re.findall(r"`+", plain)), default=0)
    fence = "`" * max(3, longest + 1)
    return f"{fence}{language}\n{plain}\n{fence}"


def command_data(text: str) -> str:
    """Return text as the message of a workflow command."""
    return plain_text(text).replace("%", "%25").replace("\n", "%0A")


def command_property(text: str) -> str:
    """Return text as a property of a workflow command, such as its title."""
    return command_data(text).replace(":", "%3A").replace(",", "%2C")


def shortened_command(escaped: str, most: int) -> str:
    """Return an escaped message cut to at most `most` characters, without splitting an escape."""
    return escaped if len(escaped) <= most else f"{_PARTIAL_ESCAPE.sub('', escaped[: most - 1])}…"


def log_text(text: str, encoding: str) -> str:
    """Return plain text in the encoding of a stream, without `##[command]`, which GitHub executes in any line."""
    plain = _LEGACY_COMMAND.sub("# #", plain_text(text))
    return plain.encode(encoding, errors="backslashreplace").decode(encoding)
