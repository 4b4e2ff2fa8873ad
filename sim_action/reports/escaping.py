"""Text from scenarios, models and scripts made harmless for the place where it is going to stand."""

from __future__ import annotations

import re
from typing import Final

# What colours a terminal, moves its cursor or sets its title: CSI and OSC sequences of ECMA-48.
_TERMINAL_SEQUENCE: Final = re.compile(r"\x1b(?:\[[0-?]*[ -/]*[@-~]|\][^\x07\x1b]*(?:\x07|\x1b\\))")
_LINE_END: Final = re.compile(r"\r\n|[\r\v\f\x1c-\x1e\x85\u2028\u2029]")
# Control characters but tab and newline, what reorders text (Unicode annex 9), lone surrogates, U+FFFE and U+FFFF.
_UNWANTED: Final = re.compile(
    r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]"
)
# References and not backslashes: they hold in the HTML between the Markdown, too. In them, no character is structure.
_MARKDOWN: Final = str.maketrans({character: f"&#{ord(character)};" for character in "|*`[]\\~$"}) | str.maketrans(
    {
        "&": "&amp;",
        "<": "&lt;",
        ">": "&gt;",
        # Mentions and references are looked for after rendering; an invisible space stops that.
        "@": "@&#8203;",
        "#": "&#35;&#8203;",
    }
)
# Between letters and digits an underscore is no markup, and names are full of them.
_MARKUP_UNDERSCORE: Final = re.compile(r"(?<![A-Za-z0-9])_|_(?![A-Za-z0-9])")
_PARTIAL_ESCAPE: Final = re.compile(r"%.?\Z")
_LEGACY_COMMAND: Final = re.compile(r"##(?=\[)")


def plain_text(text: str) -> str:
    """Text without what acts on a terminal or is forbidden in XML 1.0; every kind of line end becomes a newline."""
    return _UNWANTED.sub("", _LINE_END.sub("\n", _TERMINAL_SEQUENCE.sub("", text)))


def one_line(text: str) -> str:
    """Plain text with single spaces for all white space."""
    return " ".join(plain_text(text).split())


def shortened(text: str, most: int) -> str:
    """Text of at most so many characters."""
    return text if len(text) <= most else f"{text[: most - 1]}…"


def markdown_text(text: str) -> str:
    """Text on one line of Markdown, HTML or a table, and nothing but text: no link, mention, markup or cell."""
    escaped = _MARKUP_UNDERSCORE.sub("&#95;", one_line(text).translate(_MARKDOWN))
    return escaped.replace("://", "&#58;//").replace("www.", "www&#46;")


def markdown_block(text: str, language: str = "text") -> str:
    """Text as a fenced block that it cannot end: the fence is longer than any run of backticks in it."""
    plain = plain_text(text).strip("\n")
    longest = max((len(run) for run in re.findall(r"`+", plain)), default=0)
    fence = "`" * max(3, longest + 1)
    return f"{fence}{language}\n{plain}\n{fence}"


def command_data(text: str) -> str:
    """Text as the message of a workflow command."""
    return plain_text(text).replace("%", "%25").replace("\n", "%0A")


def command_property(text: str) -> str:
    """Text as a property of a workflow command, such as its title."""
    return command_data(text).replace(":", "%3A").replace(",", "%2C")


def shortened_command(escaped: str, most: int) -> str:
    """An escaped message of at most so many characters, no escape cut in half."""
    return escaped if len(escaped) <= most else f"{_PARTIAL_ESCAPE.sub('', escaped[: most - 1])}…"


def log_text(text: str, encoding: str) -> str:
    """Plain text that a stream can show, without `##[command]`, which GitHub obeys anywhere in a line of its log."""
    plain = _LEGACY_COMMAND.sub("# #", plain_text(text))
    return plain.encode(encoding, errors="backslashreplace").decode(encoding)
