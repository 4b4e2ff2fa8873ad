"""Links in reports: paths relative to the workspace, source lines, the command to run again, moments of the replay."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Iterator
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Final
from urllib.parse import quote, urlsplit

from sim_action.core.errors import Location
from sim_action.core.files import read_at_most
from sim_action.engines import ENGINES
from sim_action.reports import ReportOptions
from sim_action.reports.escaping import one_line
from sim_action.results.artifacts import REPORT_FILE, namesake_number
from sim_action.results.outcome import Outcome
from sim_action.scenario.source import varies_seed

# The characters that every shell treats alike between double quotes.
_PLAIN: Final = re.compile(r"[\w .,:;=+/()\[\]-]+", re.ASCII)
_MAX_SOURCE_BYTES: Final = 1_000_000
_BARE: Final = re.compile(r"[\w.,:=+/-]+", re.ASCII)


def rerun_command(outcome: Outcome, options: ReportOptions) -> str:
    """Return the command that runs an outcome again from the workspace; empty if there is nothing to run."""
    if not outcome.file or any(failure.kind == "missing" for failure in outcome.failures):
        return ""
    if outcome.call:
        return " ".join(_quoted(one_line(word)) for word in outcome.call)
    file = one_line(relative_path(options.workspace, outcome.file))
    if outcome.name == Path(outcome.file).name:
        # The file could not be read, so the names of its scenarios are unknown.
        return " ".join(map(_quoted, ("sim-action", "validate", file)))
    name, backend = _named(outcome)
    if outcome.statistics is not None and outcome.group is not None:
        # A gate has the name of its scenario with the listed values, and no run has this name.
        name = outcome.group
    # Keep the name exactly, including spaces, unless no scenario can have this name.
    words = ["sim-action", "run", file, "--only", name if name.isprintable() else one_line(name)]
    # If the seed is varied, the name already selects it; --seed would draw other variations.
    seed = outcome.seed if outcome.scenario_seed is None else outcome.scenario_seed
    if seed and not varies_seed(outcome.variation):
        words += ["--seed", str(seed)]
    if backend:
        words += ["--backend", backend]
    if outcome.status == "flaky" and outcome.repeats:
        words += ["--repeat", str(outcome.repeats.count)]
    words += _permitted(options)
    return " ".join(map(_quoted, words))


def _permitted(options: ReportOptions) -> Iterator[str]:
    """Yield the options that permit what the call has permitted; folders are seen from the workspace."""
    permissions = options.permissions
    for name, folder in permissions.packages:
        yield "--package"
        yield one_line(f"{name}={_seen_from(options.workspace, folder)}")
    for name in permissions.pass_env:
        yield "--pass-env"
        yield name
    if permissions.outside:
        yield "--allow-outside"


def _seen_from(workspace: Path, folder: str) -> str:
    try:
        return Path(os.path.relpath(folder, workspace.resolve())).as_posix()
    except ValueError:  # on another drive of Windows
        return folder


def _named(outcome: Outcome) -> tuple[str, str]:
    """Return the names of scenario and engine; the engine is empty for a run that compares two engines."""
    for backend in ENGINES:
        if outcome.name.endswith(suffix := f" [{backend}]"):
            return outcome.name.removesuffix(suffix), ""
    engine = (outcome.engine or "").partition(" ")[0].lower()
    return outcome.name, engine if engine in ENGINES else ""


def _quoted(word: str) -> str:
    if _BARE.fullmatch(word):
        return word
    return f'"{word}"' if _PLAIN.fullmatch(word) else shlex.quote(word)


def scenario_lines(workspace: Path, file: str) -> list[str]:
    """Return the lines of a scenario file of the workspace; empty for any other name that results may have."""
    path = Path(file)
    if path.suffix not in (".yml", ".yaml"):
        return []
    with suppress(OSError, ValueError):
        inside = path.resolve().is_relative_to(workspace.resolve())
        text = read_at_most(path, _MAX_SOURCE_BYTES) if inside else None
        return [] if text is None else text.decode().splitlines()
    return []


def replay_link(outcome: Outcome, options: ReportOptions, time: float | None = None) -> str:
    """Return the link to a sim time (s) in the report, `report.html#scenario=...&t=4.5`; empty without a replay."""
    if outcome.replay is None or "report" in options.silenced:
        return ""
    return f"{REPORT_FILE}{fragment(outcome.name, time, namesake_number(outcome.name, outcome.replay))}"


def reason_time(outcome: Outcome) -> float | None:
    """Return the sim time in s of the first reason why an outcome is no pass; None if there is none, or no time."""
    times = [failure.time for failure in outcome.failures]
    times += [expected.verdict.time for expected in outcome.causes]
    return next(iter(times), None)


def fragment(scenario: str, time: float | None = None, number: int = 1) -> str:
    """Return the URL fragment of the report for a scenario, `number` of several, and for a sim time in s."""
    which = "" if number == 1 else f"&n={number}"
    moment = "" if time is None else f"&t={round(time, 2):g}"
    # The page compares names in this form.
    return f"#scenario={quote(one_line(scenario), safe='')}{which}{moment}"


def relative_path(workspace: Path, file: str | Path) -> str:
    """Return a path relative to the workspace or the current folder, with forward slashes; else absolute."""
    inside = _inside(workspace, file)
    return inside if inside is not None and not Path(inside).is_absolute() else _inside(Path(), file) or str(file)


def _inside(workspace: Path, file: str | Path) -> str | None:
    """Return a path relative to a folder if it is inside, else absolute; None if the text is no valid path."""
    if "\0" in (text := os.fspath(file)):
        return None
    try:
        inside = _below(text, os.fspath(workspace), os.getcwd())  # noqa: PTH109 - quicker than pathlib
        if inside is not None:
            return inside
        absolute = os.path.abspath(text)  # noqa: PTH100 - links are kept as they are written
        inside = _below(os.path.realpath(absolute), os.path.realpath(workspace), "")
    except (OSError, ValueError):
        return None
    return Path(absolute).as_posix() if inside is None else inside


@lru_cache(maxsize=1024)
def _below(path: str, folder: str, _directory: str) -> str | None:
    target, root = Path(os.path.abspath(path)), Path(os.path.abspath(folder))  # noqa: PTH100 - links are kept
    return target.relative_to(root).as_posix() if target.is_relative_to(root) else None


def file_and_line(workspace: Path, location: Location) -> str:
    """Return `path:line`, or the path alone without a line."""
    path = relative_path(workspace, location.file)
    return path if location.line is None else f"{path}:{location.line}"


def stored_trace(outcome: Outcome, folder: Path) -> Path | None:
    """Return the path of an outcome's trace; `folder` contains the results file."""
    return folder / outcome.trace if outcome.trace else None


def source_url(location: Location, options: ReportOptions) -> str:
    """Return the URL of a source line at the tested commit; empty if it is not known, or outside."""
    path = _inside(options.workspace, location.file) or str(location.file)
    names = ("GITHUB_SERVER_URL", "GITHUB_REPOSITORY", "GITHUB_SHA")
    server, repository, commit = (options.environment.get(name, "") for name in names)
    if urlsplit(server).scheme not in ("http", "https") or not (repository and commit) or path.startswith("/"):
        return ""
    line = "" if location.line is None else f"#L{location.line}"
    return f"{server}/{repository}/blob/{commit}/{quote(path, errors='replace')}{line}"
