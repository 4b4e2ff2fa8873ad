"""`sim-action view`: from what was typed to the address of a report, or of a moment in it, and to a browser."""

from __future__ import annotations

import os
import sys
import webbrowser
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from sim_action.core.errors import UsageError
from sim_action.core.messages import did_you_mean, escaped_line
from sim_action.reports.links import REPORT_FILE, fragment
from sim_action.results.results_json import RESULTS_FILE, Results


@dataclass(frozen=True, slots=True)
class ViewRequest:
    """What the command line asks for; `place`: a report, results, or their folder; `time`: sim time in s."""

    place: Path
    only: str | None = None
    time: float | None = None


def address(request: ViewRequest) -> str:
    """Of the report, as browsers take it. Raises UsageError if it is not there, or has no such scenario."""
    report = _report(request.place)
    if request.only is None and request.time is None:
        return report.as_uri()
    name = _scenario(report.with_name(RESULTS_FILE), request.only)
    return f"{report.as_uri()}{fragment(name, request.time)}"


def opened(shown: str, environment: Mapping[str, str]) -> bool:
    """Opens an address in the user's browser; False where nobody would see it."""
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
    raise UsageError(escaped_line(f"no report at {path}: sim-action run writes it, unless it is told --no-report"))


def _scenario(results: Path, only: str | None) -> str:
    """The name that is meant; without results beside the report, as it was typed. Raises UsageError."""
    if not results.is_file():
        if only is None:
            raise UsageError("--time is of a scenario: name it with --only")
        return only
    names = [outcome.name for outcome in Results.read(results).outcomes]
    if only is None:
        return _sole(names)
    if only not in names:
        raise UsageError(escaped_line(f"no scenario '{only}' is in the report{did_you_mean(only, names)}"))
    return only


def _sole(names: Iterable[str]) -> str:
    only, *others = list(names) or [""]
    if others or not only:
        raise UsageError("--time is of a scenario: name it with --only")
    return only


def _has_display(environment: Mapping[str, str]) -> bool:
    """Whether a browser has somewhere to open; one in a terminal would take that."""
    if sys.platform != "linux":
        return True
    return any(environment.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"))


def view(request: ViewRequest, *, print_only: bool) -> None:
    """Opens a report; says where it is, also for those whose system drops what stands behind a `#`."""
    shown = address(request)
    if not print_only and not opened(shown, os.environ):
        sys.stderr.write("sim-action: no browser can be opened here; this is the address of the report\n")
    sys.stdout.write(f"{shown}\n")
