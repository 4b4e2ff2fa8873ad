"""How error messages are worded: one printable line, what was found, the nearest of what is allowed."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from itertools import islice
from typing import Final

_LONGEST_MESSAGE: Final = 2000
_LONGEST_VALUE: Final = 60
# What a stranger's file may name without end costs no more than this.
_NAMES_COMPARED: Final = 1_000
_LONGEST_NAME: Final = 100
_NAMES_LISTED: Final = 30
_FEW: Final = 10
_VOWELS: Final = frozenset("aeiou")


def escaped_line(text: str) -> str:
    """Text as a message may hold it: what would break the line or act on a terminal is escaped, and it ends."""
    safe = "".join(char if char.isprintable() else repr(char)[1:-1] for char in text[:_LONGEST_MESSAGE])
    return safe if len(text) <= _LONGEST_MESSAGE else f"{safe}..."


def log_line(text: str) -> str:
    """A line that is text to GitHub, too: `::command::` acts at its beginning, and `##[command]` anywhere in it."""
    line = escaped_line(text).replace("##[", "# #[")
    return f"./{line}" if line.lstrip().startswith("::") else line


def shown(value: object) -> str:
    """A value of a user's file as a message quotes it."""
    if value is None:
        return "nothing"
    if isinstance(value, dict):
        return "a map of keys"
    if isinstance(value, (tuple, list)):
        return f"a list of {len(value)}" if value else "an empty list"
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    return text if len(text) <= _LONGEST_VALUE else f"{text[: _LONGEST_VALUE - 3]}..."


def counted(count: int, noun: str) -> str:
    """Such as "1 variation", "2 variations"."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def with_article(noun: str) -> str:
    """Such as "an int", "a str"."""
    return f"{'an' if noun[:1].lower() in _VOWELS else 'a'} {noun}"


def did_you_mean(found: str, allowed: Iterable[str]) -> str:
    """The end of an error message: the nearest allowed name, if one is near, then all of them, up to a screenful."""
    names = sorted(allowed)
    near = nearest(found, names)
    hint = "" if near is None else f"; did you mean '{near}'?"
    more = len(names) - _NAMES_LISTED
    ending = f", and {more:,} more" if more > 0 else ""
    return f"{hint} (allowed: {', '.join(names[:_NAMES_LISTED]) or 'none'}{ending})"


def nearest(found: str, names: Iterable[str]) -> str | None:
    """The name that is most like another, if one is; of very many, and of long ones, not all are compared."""
    short = (name for name in names if len(name) <= _LONGEST_NAME)
    near = difflib.get_close_matches(found[:_LONGEST_NAME], islice(short, _NAMES_COMPARED), n=1)
    return near[0] if near else None


class FirstFew:
    """Tells the first few of something from the rest: a file decides how many there are, and each may cost much."""

    def __init__(self) -> None:
        self._left = _FEW

    def one_more(self) -> bool:
        """Whether the next one is among them."""
        self._left -= 1
        return self._left >= 0
