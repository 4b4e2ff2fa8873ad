"""Markdown tables and fenced blocks, and text without markup."""

from __future__ import annotations

from collections.abc import Iterable


def table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """Return a Markdown table; a pipe in a cell is escaped."""
    first, *others = ("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in (head, *rows))
    return "\n".join([first, f"|{'---|' * len(head)}", *others]) + "\n"


def bullets(rows: Iterable[tuple[str, str]]) -> str:
    """Return a list of heads and texts; heads whose texts are equal and follow each other share an entry."""
    heads: list[tuple[str, str]] = []
    for head, text in rows:
        if heads and heads[-1][1] == text:
            heads[-1] = (f"{heads[-1][0]}, {head}", text)
        else:
            heads.append((head, text))
    return "".join(f"- {head}: {text}\n" for head, text in heads)


def fenced(language: str, text: str) -> str:
    """Return a fenced code block."""
    return f"```{language}\n{text}```\n"


def escaped(text: str) -> str:
    """Return text in which Markdown sees no markup; code in backticks stays code."""
    parts = text.replace("\b", "").split("`")
    parts[::2] = [part.replace("*", r"\*").replace("<", r"\<").replace("[", r"\[") for part in parts[::2]]
    return "`".join(parts)
