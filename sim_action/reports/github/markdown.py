"""Pieces of GitHub-flavoured Markdown; arguments called `markdown` are taken as they are, all others are escaped."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from urllib.parse import quote

from sim_action.core.errors import Location
from sim_action.reports import ReportOptions
from sim_action.reports.escaping import markdown_block, markdown_text
from sim_action.reports.links import place, seen_from


def code(text: str) -> str:
    """Text in a fixed-width font; HTML, because a backtick ends what backticks began."""
    return f"<code>{markdown_text(text)}</code>"


def code_of_link(link: str) -> str:
    """A link to be copied: behind its `#` no invisible space may stand, as it does elsewhere."""
    return "&#35;".join(map(markdown_text, link.split("#"))).join(("<code>", "</code>"))


def table(columns: Sequence[str], markdown_rows: Iterable[str]) -> str:
    """A table; columns whose title begins with a space hold numbers, and are aligned to the right."""
    rules = ["---:" if title.startswith(" ") else "---" for title in columns]
    return "\n".join([row(*(title.strip() for title in columns)), row(*rules), *markdown_rows])


def row(*markdown_cells: str) -> str:
    """A row of a table."""
    return f"| {' | '.join(markdown_cells)} |"


def folded(title: str, markdown: str) -> str:
    """What is seen when its title is clicked."""
    return f"<details><summary>{markdown_text(title)}</summary>\n\n{markdown}\n\n</details>"


def shell_block(command: str) -> str:
    """A command that can be copied; one line, without backticks at its beginning."""
    return markdown_block(command, "sh")


def source_link(options: ReportOptions, location: Location | None) -> str:
    """`path:line`, as a link to the file at this commit where the environment says which that is; empty of no place."""
    if location is None:
        return ""
    shown = code(place(options.workspace, location))
    path = seen_from(options.workspace, location.file)
    names = ("GITHUB_SERVER_URL", "GITHUB_REPOSITORY", "GITHUB_SHA")
    server, repository, commit = (options.environment.get(name) for name in names)
    if not (server and repository and commit) or path.startswith("/"):
        return shown
    line = "" if location.line is None else f"#L{location.line}"
    return f"[{shown}]({server}/{repository}/blob/{commit}/{quote(path, errors='replace')}{line})"
