"""Elements of GitHub-flavoured Markdown. Arguments named `markdown...` are inserted unchanged, others are escaped."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import Final

from sim_action.core.errors import Location
from sim_action.core.wording import counted, shortened
from sim_action.reports import ReportOptions
from sim_action.reports.escaping import markdown_text
from sim_action.reports.links import file_and_line, source_url
from sim_action.reports.table import Row, Table, value_text

MAX_IN_MESSAGE: Final = 500  # the largest number of characters of a message in a table or list


def code(text: str) -> str:
    """Return text as inline code; HTML is used because text may contain backticks."""
    return f"<code>{markdown_text(text)}</code>"


def code_of_link(link: str) -> str:
    """Return a link as inline code that can be copied, without the zero-width space after `#`."""
    return "&#35;".join(map(markdown_text, link.split("#"))).join(("<code>", "</code>"))


def markdown_table(table: Table, options: ReportOptions | None = None) -> str:
    """Return a table, with its rest folded; empty without rows. See `markdown_row`."""
    written = partial(markdown_row, table, options=options)
    shown, rest = (markdown_rows(table, map(written, rows)) for rows in (table.rows, table.rest))
    return paragraphs(shown, folded(table.rest_title, rest) if rest else "")


def markdown_rows(table: Table, rows: Iterable[str]) -> str:
    """Return the titles of a table and some of its rows, which are Markdown; empty without rows."""
    written = list(rows)
    titles = ("", *table.titles)
    rules = ("---:" if title.startswith(" ") else "---" for title in titles)
    return "\n".join([_cells(title.strip() for title in titles), _cells(rules), *written]) if written else ""


def markdown_row(table: Table, row: Row, options: ReportOptions | None = None) -> str:
    """Return a row of a table; `options`: for the links to places. Without them, places are not linked."""
    place = f"<sub>{source_link(options, row.location)}</sub>" if row.stands_out and row.location is not None else ""
    replay = f"replay: {code_of_link(row.replay)}" if row.replay else ""
    name = f"**{message_text(row.name)}**" if row.name else ""
    message = "<br>".join(message_text(text) for text in (row.message, row.interval) if text)
    below = ((name, place), (message, replay)) if table.message else ((name, message, place, replay),)
    texts = ("<br>".join(filter(None, lines)) for lines in below)
    kind = (row.kind,) if table.kind else ()
    # A value stays on one line with its unit.
    values = (markdown_text(value_text(value)).replace(" ", "&nbsp;") for value in table.values_of(row))
    return _cells((row.display.icon, *kind, *texts, *values))


def folded(title: str, markdown: str) -> str:
    """Return a section that is folded until its title is clicked."""
    return f"<details><summary>{markdown_text(title)}</summary>\n\n{markdown}\n\n</details>"


def paragraphs(*markdown: str) -> str:
    """Join paragraphs; empty ones are omitted."""
    return "\n\n".join(filter(None, markdown))


def dotted(*markdown: str) -> str:
    """Join the parts of a subtitle by dots; empty ones are omitted."""
    return " · ".join(filter(None, markdown))


def source_link(options: ReportOptions | None, location: Location | None) -> str:
    """Return `path:line`, linked to the file at the tested commit if it is known; empty for no location."""
    if location is None or options is None:
        return "" if location is None else code(str(location))
    shown = code(file_and_line(options.workspace, location))
    url = source_url(location, options)
    return f"[{shown}]({url})" if url else shown


def _cells(markdown: Iterable[str]) -> str:
    return f"| {' | '.join(markdown)} |"


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


def left_out_note(total: int, most: int, what: str, ending: str = "") -> str:
    """Return the number of entries that are not shown as Markdown; empty if all are. `ending`: where, or why."""
    if total <= most:
        return ""
    return f"_{counted(total - most, f'more {what}')} {'is' if total - most == 1 else 'are'} not shown{ending}._"
