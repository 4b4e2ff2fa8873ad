"""Reports: their options.

`terminal`, `junit`, `github` and `html` hold the reports of a run, and `writing` the table of them; `comparison` holds
the report of `sim-action compare`.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, Literal

from sim_action.core.permissions import Permissions
from sim_action.core.records import dataclass
from sim_action.results.artifacts import REPORT_FILE
from sim_action.results.journal import JOURNAL_FILE
from sim_action.results.output_folder import Room
from sim_action.results.results_json import RESULTS_FILE

if TYPE_CHECKING:
    from sim_action.results.shard_results import EarlierRun

Verbosity = Literal["quiet", "normal", "verbose", "json"]
"""The amount of text on the terminal.

- quiet: only failures and one closing line.
- verbose: also notes, messages of the engine and the output of controllers.
- json: on standard output, the content of `results.json` and nothing else.
"""

_NO_PERMISSIONS: Final = Permissions()
_NO_ROOM: Final = Room()


@dataclass(frozen=True, slots=True)
class ReportOptions:
    """The targets and options of reports."""

    folder: Path  # the existing output folder, with `results.json`
    junit: Path  # the path of the JUnit XML
    junit_strict: bool  # True to omit everything that the Jenkins schema `junit-10.xsd` forbids
    # the environment variables; GitHub names its files there (`GITHUB_STEP_SUMMARY`, ...)
    environment: Mapping[str, str]
    workspace: Path  # the folder to which paths in reports are relative
    verbosity: Verbosity = "normal"  # the amount of text on the terminal
    silenced: frozenset[str] = frozenset()  # the names of reports that are not written
    # the number of outcomes of an earlier call, see `run --resume`; None: it was not asked for
    taken_over: int | None = None
    # what the caller permits; the command that runs a scenario again permits the same
    permissions: Permissions = _NO_PERMISSIONS
    against: EarlierRun | None = None  # the earlier run that `report.html` compares with; None: there is none
    room: Room = _NO_ROOM  # the space for required reports

    @property
    def files(self) -> tuple[str, ...]:
        """The files of a call in the output folder, without the files of its runs."""
        junit = Path(os.path.relpath(self.junit, self.folder))
        return (JOURNAL_FILE, RESULTS_FILE, REPORT_FILE, *(() if ".." in junit.parts else (junit.as_posix(),)))


_WORKSPACES: Final = MappingProxyType(
    {
        "GITHUB_WORKSPACE": ("GITHUB_WORKSPACE",),
        "CI_PROJECT_DIR": ("CI_PROJECT_DIR",),
        # Other programs have a variable of this name, too.
        "WORKSPACE": ("JENKINS_URL", "JENKINS_HOME", "BUILD_TAG"),
    }
)
"""Variable with the workspace of a CI service -> variables of which one must be set for it to count."""


@dataclass(frozen=True, slots=True)
class ReportRequest:
    """The report options of the command line."""

    folder: Path
    junit: Path | None
    junit_strict: bool
    verbosity: Verbosity
    silenced: frozenset[str]  # the names of reports that are switched off
    against: str | None = None  # the results of an earlier run, as typed; None: `report.html` compares with nothing

    @property
    def outputs(self) -> list[Path]:
        """The folder and the file that are written."""
        return [path for path in (self.folder, self.junit) if path is not None]


def workspace_of(environment: Mapping[str, str], current_folder: Path) -> Path:
    """Return the folder to which paths in reports are relative: the CI service's workspace, else the current folder.

    A variable may come from another machine, or from another program. A value that is no absolute path of an existing
    folder does not count; the repository above the current folder does then.
    """
    stated = [environment.get(name, "") for name, marks in _WORKSPACES.items() if any(map(environment.get, marks))]
    for name in filter(None, stated):
        with suppress(OSError, ValueError):
            if Path(name).is_absolute() and Path(name).is_dir():
                return Path(name)
    above = (folder for folder in (current_folder, *current_folder.parents) if (folder / ".git").exists())
    return next(above, current_folder) if any(stated) else current_folder
