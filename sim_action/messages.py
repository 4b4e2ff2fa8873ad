"""How error messages are worded: one printable line, what was found, the nearest of what is allowed."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Final

_LONGEST_MESSAGE: Final = 2000
_LONGEST_VALUE: Final = 60


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
        return f"a list of {len(value)}"
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    return text if len(text) <= _LONGEST_VALUE else f"{text[: _LONGEST_VALUE - 3]}..."


def did_you_mean(found: str, allowed: Iterable[str]) -> str:
    """The end of an error message: the nearest allowed name, if one is near, then all of them."""
    names = sorted(allowed)
    near = difflib.get_close_matches(found, names, n=1)
    hint = f"; did you mean '{near[0]}'?" if near else ""
    return f"{hint} (allowed: {', '.join(names) or 'none'})"
