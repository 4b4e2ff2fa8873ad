"""How to see again what a report tells of: the command that runs it, and the moment in the report's replay."""

from __future__ import annotations

import os
import re
import shlex
from pathlib import Path
from typing import Final
from urllib.parse import quote

from sim_action.core.errors import Location
from sim_action.engines import ENGINES
from sim_action.reports import ReportOptions
from sim_action.reports.escaping import one_line
from sim_action.results.outcome import Outcome
from sim_action.results.stored_files import namesake_number

REPORT_FILE: Final = "report.html"

# What every shell takes alike between double quotes.
_PLAIN: Final = re.compile(r"[\w .,:;=+/()\[\]-]+", re.ASCII)
_BARE: Final = re.compile(r"[\w.,:=+/-]+", re.ASCII)


def rerun_command(outcome: Outcome, options: ReportOptions) -> str:
    """What to type in the workspace to see it again; empty if there is nothing to run."""
    if not outcome.file or any(failure.kind == "missing" for failure in outcome.failures):
        return ""
    if outcome.call:
        return " ".join(_quoted(one_line(word)) for word in outcome.call)
    file = one_line(seen_from(options.workspace, outcome.file))
    if outcome.name == Path(outcome.file).name:
        # It could not be read: nobody knows how its scenarios are called.
        return " ".join(map(_quoted, ("sim-action", "validate", file)))
    name, backend = _named(outcome)
    # To the letter, spaces and all, unless it is no name that a scenario can have.
    words = ["sim-action", "run", file, "--only", name if name.isprintable() else one_line(name)]
    # Of a variation of the seed, the name says it, and another would draw other variations.
    if outcome.seed and not any(varied.key == "seed" for varied in outcome.variation):
        words += ["--seed", str(outcome.seed)]
    if backend:
        words += ["--backend", backend]
    if outcome.status == "flaky" and outcome.repeats:
        words += ["--repeat", str(outcome.repeats.count)]
    return " ".join(map(_quoted, words))


def _named(outcome: Outcome) -> tuple[str, str]:
    """The scenario and the engine; of a run that is held against one on another engine, of both."""
    for backend in ENGINES:
        if outcome.name.endswith(suffix := f" [{backend}]"):
            return outcome.name.removesuffix(suffix), ""
    engine = (outcome.engine or "").partition(" ")[0].lower()
    return outcome.name, engine if engine in ENGINES else ""


def _quoted(word: str) -> str:
    if _BARE.fullmatch(word):
        return word
    return f'"{word}"' if _PLAIN.fullmatch(word) else shlex.quote(word)


def replay_link(outcome: Outcome, options: ReportOptions, time: float | None = None) -> str:
    """Where in the report a moment is, in s of sim time: `report.html#scenario=...&t=4.5`; empty if it is not there."""
    if outcome.replay is None or "report" in options.silenced:
        return ""
    return f"{REPORT_FILE}{fragment(outcome.name, time, namesake_number(outcome.name, outcome.replay))}"


def fragment(scenario: str, time: float | None = None, number: int = 1) -> str:
    """What stands behind the address of a report to open it at a scenario, and at a moment, in s of sim time.

    `number`: which of several of that name.
    """
    which = "" if number == 1 else f"&n={number}"
    moment = "" if time is None else f"&t={round(time, 2):g}"
    # As the page calls it.
    return f"#scenario={quote(one_line(scenario), safe='')}{which}{moment}"


def seen_from(workspace: Path, file: str | Path) -> str:
    """A path relative to the workspace if it is inside, else absolute; relative ones start from the current folder."""
    try:
        absolute = Path(os.path.abspath(file))  # noqa: PTH100 - links are kept as they are written
        candidates = [(absolute, Path(os.path.abspath(workspace)))]  # noqa: PTH100 - as above
        candidates.append((absolute.resolve(), workspace.resolve()))
    except (OSError, ValueError, RuntimeError):
        # A text that can be no path, such as one with a NUL in it, or a link that leads in a circle.
        return str(file)
    for path, root in candidates:
        if path.is_relative_to(root):
            return path.relative_to(root).as_posix()
    return absolute.as_posix()


def place(workspace: Path, location: Location) -> str:
    """`path:line`, or the path alone."""
    path = seen_from(workspace, location.file)
    return path if location.line is None else f"{path}:{location.line}"


def stored_trace(outcome: Outcome, folder: Path) -> Path | None:
    """The trace of an outcome, whose results file is in `folder`."""
    return folder / outcome.trace if outcome.trace else None
