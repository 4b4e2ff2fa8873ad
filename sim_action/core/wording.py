"""The wording of error messages: one printable line, the found value, the nearest allowed name, and lines of a file."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Collection, Iterable, Sequence
from contextlib import suppress
from itertools import islice
from typing import Final, NamedTuple

MAX_MESSAGE_CHARS: Final = 2_000  # the largest number of characters of a message
_MAX_VALUE_CHARS: Final = 60
_MAX_LINE_CHARS: Final = 200
# Limits on the cost of files with any number of names.
_MAX_NAMES_COMPARED: Final = 1_000
_MIN_BEGINNING_CHARS: Final = 3
_MAX_NAME_CHARS: Final = 100
_MAX_NAMES_LISTED: Final = 40
_MAX_NAMES_QUOTED: Final = 5
_MAX_HINTS: Final = 10
_VOWELS: Final = frozenset("aeiou")


def escaped_line(text: str) -> str:
    """Return text as one printable line of limited length; control characters are escaped."""
    safe = "".join(char if char.isprintable() else repr(char)[1:-1] for char in text[:MAX_MESSAGE_CHARS])
    return safe if len(text) <= MAX_MESSAGE_CHARS else f"{safe}..."


def shortened(text: str, most: int) -> str:
    """Return text cut to at most `most` characters, with an ellipsis at the end if it was cut."""
    return text if len(text) <= most else f"{text[: most - 1]}…"


def log_line(text: str) -> str:
    """Return a line that GitHub does not read as a workflow command (`::command::`, `##[command]`)."""
    line = escaped_line(text).replace("##[", "# #[")
    return f"./{line}" if line.lstrip().startswith("::") else line


def system_reason(error: Exception) -> str:
    """Return the reason of an error of the operating system as the end of a sentence: "no space left on device"."""
    if isinstance(error, MemoryError):
        return "out of memory"
    reason = (error.strerror if isinstance(error, OSError) else None) or str(error) or type(error).__name__
    return reason[:1].lower() + reason[1:]


def quoted(names: Sequence[str]) -> str:
    """Return names in quotes: the first five, and the number of the others."""
    return first_of([f"'{name}'" for name in names], _MAX_NAMES_QUOTED)


def first_of(texts: Collection[str], most: int) -> str:
    """Return the first texts with commas between them, and the number of the others: "a, b and 3 more"."""
    more = len(texts) - most
    return ", ".join(islice(texts, most)) + (f" and {more} more" if more > 0 else "")


def note(message: str) -> None:
    """Print a note on standard error, as one line. A closed stream is ignored."""
    with suppress(OSError, ValueError):
        sys.stderr.write(f"{log_line(f'sim-action: {message}')}\n")
        sys.stderr.flush()


def warn(message: str) -> None:
    """Print a warning on standard error, as one line."""
    note(f"warning: {message}")


def shown(value: object) -> str:
    """Return a value from a user's file as messages quote it."""
    if value is None:
        return "nothing"
    if isinstance(value, dict):
        return "a map of keys"
    if isinstance(value, (tuple, list)):
        return f"a list of {len(value)}" if value else "an empty list"
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    return text if len(text) <= _MAX_VALUE_CHARS else f"{text[: _MAX_VALUE_CHARS - 3]}..."


def counted(count: int, noun: str) -> str:
    """Return a count with its noun, such as "1 variation" or "2 variations"."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def free_name(name: str, taken: set[str]) -> str:
    """Return a name, with underscores at its end if it is taken, and add it to those."""
    while name in taken:
        name += "_"
    taken.add(name)
    return name


def with_article(noun: str) -> str:
    """Return a noun with its article, such as "an int" or "a str"."""
    return f"{'an' if noun[:1].lower() in _VOWELS else 'a'} {noun}"


def did_you_mean(unknown: str, allowed: Iterable[str]) -> str:
    """Return the end of a message about an unknown name: the nearest allowed name, then the list of allowed names."""
    names = sorted(set(allowed))
    near = nearest(unknown, names)
    hint = "" if near is None else f"; did you mean '{near}'?"
    more = len(names) - _MAX_NAMES_LISTED
    ending = f", and {more:,} more" if more > 0 else ""
    return f"{hint} (allowed: {', '.join(names[:_MAX_NAMES_LISTED]) or 'none'}{ending})"


def nearest(unknown: str, names: Iterable[str]) -> str | None:
    """Return the most similar of the first names, else the only one that begins with `unknown`, else None."""
    short = list(islice((name for name in names if len(name) <= _MAX_NAME_CHARS), _MAX_NAMES_COMPARED))
    if near := difflib.get_close_matches(unknown[:_MAX_NAME_CHARS], short, n=1):
        return near[0]
    longer = [name for name in short if len(unknown) >= _MIN_BEGINNING_CHARS and name.startswith(unknown)]
    return longer[0] if len(longer) == 1 else None


class FirstFew:
    """A counter that limits costly hints to the first few, because a file decides how many problems it has."""

    def __init__(self) -> None:
        self._left = _MAX_HINTS

    def one_more(self) -> bool:
        """Count one more, and return True while it belongs to the first few."""
        self._left -= 1
        return self._left >= 0


class SourceLine(NamedTuple):
    """A line of a file."""

    number: int  # its number, counted from 1
    text: str  # the line without its end
    is_marked: bool  # True for a line that the excerpt is about

    def numbered(self, width: int) -> str:
        """Return the line with a sign if it is marked, and its number in so many characters."""
        return f"{'>' if self.is_marked else ' '} {self.number:>{width}} | {self.text}".rstrip()


def excerpt(lines: Sequence[str], marked: Collection[int], around: int) -> list[SourceLine]:
    """Return the marked lines of a file, and up to `around` lines before and after each of them."""
    shown = {near for line in marked for near in range(line - around, line + around + 1)}
    return [
        SourceLine(number, shortened(text.rstrip("\r\n"), _MAX_LINE_CHARS), number in marked)
        for number, text in enumerate(lines, start=1)
        if number in shown
    ]


def as_text(lines: Sequence[SourceLine]) -> str:
    """Return the lines of an excerpt with their numbers."""
    width = len(str(lines[-1].number)) if lines else 0
    return "\n".join(line.numbered(width) for line in lines)
