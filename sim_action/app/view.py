"""The use case `view`: open a report, or a moment in it, in the browser."""

from __future__ import annotations

import os
import sys
import webbrowser
from collections.abc import Iterable, Mapping
from pathlib import Path

from sim_action.core.errors import UsageError
from sim_action.core.wording import did_you_mean, escaped_line
from sim_action.reports.links import fragment
from sim_action.results.artifacts import REPORT_FILE
from sim_action.results.results_json import RESULTS_FILE, Results


def address(place: Path, only: str | None = None, time: float | None = None) -> str:
    """Return the URL of the report. Raises UsageError if the report or the scenario does not exist.

    `place`: a report, results or their folder; `only`: the name of a scenario; `time`: a sim time in s.
    """
    report = _report(place)
    if only is None and time is None:
        return report.as_uri()
    name = _scenario(report.with_name(RESULTS_FILE), only)
    return f"{report.as_uri()}{fragment(name, time)}"


def opened(shown: str, environment: Mapping[str, str]) -> bool:
    """Open a URL in the browser; return False if no browser can be opened."""
    if not _has_display(environment):
        return False
    try:
        return webbrowser.open(shown)
    except (webbrowser.Error, OSError):
        return False


def _report(place: Path) -> Path:
    try:
        folder = place if place.is_dir() else place.parent
        path = folder / REPORT_FILE if place in (folder, folder / RESULTS_FILE) else place
        if path.is_file():
            return path.resolve()
    except (OSError, ValueError):  # too long, a NUL in it
        path = place
    raise UsageError(escaped_line(f"no report found at {path}; `sim-action run` writes one unless --no-report is set"))


def _scenario(results: Path, only: str | None) -> str:
    """Return the name of the scenario. Without a results.json it cannot be checked. Raises UsageError."""
    if not results.is_file():
        if only is None:
            raise UsageError("--time needs --only to select a scenario")
        return only
    names = [outcome.name for outcome in Results.read(results).outcomes]
    if only is None:
        return _sole(names)
    if only not in names:
        raise UsageError(escaped_line(f"the report has no scenario '{only}'{did_you_mean(only, names)}"))
    return only


def _sole(names: Iterable[str]) -> str:
    only, *others = list(names) or [""]
    if others or not only:
        raise UsageError("--time needs --only to select a scenario")
    return only


def _has_display(environment: Mapping[str, str]) -> bool:
    if sys.platform != "linux":
        return True
    return any(environment.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"))


def view_report(place: Path, only: str | None, time: float | None, *, print_only: bool) -> None:
    """Open a report and print its URL, see `address`: some systems drop the part behind `#` when they open it."""
    shown = address(place, only, time)
    if not print_only and not opened(shown, os.environ):
        sys.stderr.write("sim-action: no browser can be opened here; open this address yourself\n")
    sys.stdout.write(f"{shown}\n")
