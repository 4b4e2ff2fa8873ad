"""HTML, SVG included, made of elements; text becomes nothing but text, whoever wrote it."""

from __future__ import annotations

import html

from sim_action.reports.escaping import plain_text

# What has no end tag in HTML.
_VOID = frozenset({"meta", "link", "input"})


class Html(str):
    """Text that is HTML already."""

    __slots__ = ()


def text(words: str) -> Html:
    """Any text, as HTML that shows it; without what reorders or hides text."""
    return words if isinstance(words, Html) else Html(html.escape(plain_text(words)))


def element(name: str, /, *children: str, **attributes: str | float | bool | None) -> Html:
    """An element; children that are not `Html` are text.

    In names of attributes an underscore stands for a hyphen, one at the end for nothing; True: it has no value; False
    and None: it is left out.
    """
    told = "".join(_attribute(key, value) for key, value in attributes.items() if value not in (None, False))
    start = f"<{name}{told}>"
    return Html(start if name in _VOID else f"{start}{''.join(map(text, children))}</{name}>")


def joined(*parts: str) -> Html:
    """One after the other, a line each; empty ones are left out."""
    return Html("\n".join(text(part) for part in parts if part))


def _attribute(key: str, value: str | float | bool | None) -> str:
    name = key.rstrip("_").replace("_", "-")
    return f" {name}" if value is True else f' {name}="{text(str(value))}"'
