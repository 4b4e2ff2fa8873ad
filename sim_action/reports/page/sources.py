"""Places in scenario files, as links where the environment says where they can be looked at."""

from __future__ import annotations

from urllib.parse import quote, urlsplit

from sim_action.core.errors import Location
from sim_action.reports import ReportOptions
from sim_action.reports.page.markup import Html, element
from sim_action.reports.paths import place, seen_from


def source(location: Location | None, options: ReportOptions) -> Html:
    """`path:line`; a link to the file at this commit where that is known; empty of no place."""
    if location is None:
        return Html("")
    shown = element("code", place(options.workspace, location))
    path = seen_from(options.workspace, location.file)
    names = ("GITHUB_SERVER_URL", "GITHUB_REPOSITORY", "GITHUB_SHA")
    server, repository, commit = (options.environment.get(name, "") for name in names)
    if urlsplit(server).scheme not in ("http", "https") or not (repository and commit) or path.startswith("/"):
        return shown
    line = "" if location.line is None else f"#L{location.line}"
    address = f"{server}/{repository}/blob/{commit}/{quote(path, errors='replace')}{line}"
    return element("a", shown, href=address, rel="noreferrer")
