"""Elements of GitHub-flavoured Markdown. Arguments named `markdown...` are inserted unchanged, others are escaped."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

from sim_action.core.errors import Location
from sim_action.core.wording import counted, shortened
from sim_action.reports import ReportOptions
from sim_action.reports.escaping import markdown_block, markdown_text
from sim_action.reports.links import file_and_line, source_url

MAX_IN_MESSAGE: Final = 500
"""The largest number of characters of a message in a table or list."""


def code(text: str) -> str:
    """Return text as inline code; HTML is used because text may contain backticks."""
    return f"<code>{markdown_text(text)}</code>"


def code_of_link(link: str) -> str:
    """Return a link as inline code that can be copied, without the zero-width space after `#`."""
    return "&#35;".join(map(markdown_text, link.split("#"))).join(("<code>", "</code>"))


def table(columns: Sequence[str], markdown_rows: Iterable[str]) -> str:
    """Return a table; columns whose title begins with a space hold numbers and are right-aligned."""
    rules = ["---:" if title.startswith(" ") else "---" for title in columns]
    return "\n".join([row(*(title.strip() for title in columns)), row(*rules), *markdown_rows])


def row(*markdown_cells: str) -> str:
    """Return a row of a table."""
    return f"| {' | '.join(markdown_cells)} |"


def unwrapped(text: str) -> str:
    """Return text of a cell that stays on one line, such as a value with its unit."""
    return markdown_text(text).replace(" ", "&nbsp;")


def folded(title: str, markdown: str) -> str:
    """Return a section that is folded until its title is clicked."""
    return f"<details><summary>{markdown_text(title)}</summary>\n\n{markdown}\n\n</details>"


def paragraphs(*markdown: str) -> str:
    """Join paragraphs; empty ones are omitted."""
    return "\n\n".join(filter(None, markdown))


def dotted(*markdown: str) -> str:
    """Join the parts of a subtitle by dots; empty ones are omitted."""
    return " · ".join(filter(None, markdown))


def shell_block(command: str) -> str:
    """Return a one-line command as a block that can be copied."""
    return markdown_block(command, "sh")


def source_link(options: ReportOptions, location: Location | None) -> str:
    """Return `path:line`, linked to the file at the tested commit if it is known; empty for None."""
    if location is None:
        return ""
    shown = code(file_and_line(options.workspace, location))
    url = source_url(location, options)
    return f"[{shown}]({url})" if url else shown


def fitting(written: Iterable[str], most_bytes: int) -> list[str]:
    """Return the first texts, as many as fit into `most_bytes`."""
    texts: list[str] = []
    for text in written:
        most_bytes -= size_of([text])
        if most_bytes < 0:
            break
        texts.append(text)
    return texts


def size_of(texts: list[str]) -> int:
    """Return the size of texts in UTF-8, with an empty line between them."""
    return sum(len(text.encode("utf-8", errors="replace")) + 2 for text in texts)


def message_text(text: str) -> str:
    """Return a message of a run as Markdown, cut to `MAX_IN_MESSAGE` characters."""
    return markdown_text(shortened(text, MAX_IN_MESSAGE))


def left_out_note(total: int, most: int, what: str) -> str:
    """Return the number of entries that are not shown as Markdown; empty if all are."""
    if total <= most:
        return ""
    return f"_{counted(total - most, f'more {what}')} {'is' if total - most == 1 else 'are'} not shown._"
