"""Excerpts of text files around lines, for messages and reports."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Final, NamedTuple

from sim_action.core.wording import shortened

_MAX_LINE_CHARS: Final = 200


class SourceLine(NamedTuple):
    """A line of a file.

    Attributes:
        number: its number, counted from 1.
        text: the line without its end.
        is_marked: True for a line that the excerpt is about.
    """

    number: int
    text: str
    is_marked: bool

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
