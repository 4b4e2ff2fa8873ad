"""Markdown tables and fenced blocks, and text without markup."""

from __future__ import annotations

from collections.abc import Iterable


def table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """Return a Markdown table; a pipe in a cell is escaped."""
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines) + "\n"


def fenced(language: str, text: str) -> str:
    """Return a fenced code block."""
    return f"```{language}\n{text}```\n"


def escaped(text: str) -> str:
    """Return text in which Markdown sees no markup; code in backticks stays code."""
    parts = text.replace("\b", "").split("`")
    parts[::2] = [part.replace("*", r"\*").replace("<", r"\<").replace("[", r"\[") for part in parts[::2]]
    return "`".join(parts)
