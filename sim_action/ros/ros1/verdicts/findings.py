"""The findings of a launch: test results, runs of the simulation, and output."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from sim_action.core.files import read_at_most
from sim_action.core.records import dataclass
from sim_action.ros.result_files import Case, Suite, read_suite
from sim_action.ros.ros1.launch.launch_process import Ending
from sim_action.ros.ros1.launch_request import PROCESS_FILE, SimulationResult, run_folders
from sim_action.ros.ros1.verdicts.launch_output import CallbackError, callback_errors, cleaned_output
from sim_action.ros.ros1.verdicts.launch_tags import TestTag

RESULTS: Final = "results"  # folder of the results of rostest and its tests, in the folder of the call
LOGS: Final = "log"  # folder of the logs of nodes, in the folder of the call
_MAX_OUTPUT_BYTES: Final = 110_000_000


@dataclass(frozen=True, slots=True)
class Run:
    """One start of the simulation's node; `result` None: it ended before it wrote one."""

    folder: Path
    result: SimulationResult | None


@dataclass(frozen=True, slots=True)
class TestFindings:
    """The findings of one test; `tag` None: it is in an included file; `methods` None: the test wrote no results."""

    name: str
    tag: TestTag | None = None
    methods: Suite | None = None
    launched: Case | None = None
    run: Run | None = None
    callbacks: tuple[CallbackError, ...] = ()


@dataclass(frozen=True, slots=True)
class Findings:
    """The findings of a launch; `text`: the whole output, without colours."""

    ending: Ending
    exit_code: int | None
    tests: tuple[TestFindings, ...]
    runs: tuple[Run, ...]
    text: str
    callbacks: tuple[CallbackError, ...] = ()


def collect_findings(
    folder: Path, share: str, workspace: Path, tags: Sequence[TestTag], ending: tuple[Ending, int | None]
) -> Findings:
    """Read the folder of a call, whose processes see packages in `share`, and the user's are in `workspace`.

    The output is kept without `share`. `ending`: of the launch, with the exit code.
    """

    def callbacks(run: Run | None) -> tuple[CallbackError, ...]:
        return callback_errors(folder / LOGS, _process(run), workspace) if (folder / LOGS).is_dir() else ()

    results = folder / RESULTS
    reported = [suite for path in sorted(results.rglob("rostest-*.xml")) if (suite := read_suite(path))]
    launched = {case.name.removeprefix("test"): case for suite in reported for case in suite.cases}
    written = {path.stem.removeprefix("rosunit-"): path for path in sorted(results.rglob("rosunit-*.xml"))}
    runs = [Run(run, SimulationResult.read(run)) for run in run_folders(folder)]
    names = list(dict.fromkeys((*launched, *written))) or [tag.name for tag in tags]
    of_tests = _runs_of(names, written, runs)
    tests = tuple(
        TestFindings(
            name,
            next((tag for tag in tags if tag.is_called(name)), None),
            read_suite(written[name]) if name in written else None,
            launched.get(name),
            of_tests.get(name),
            callbacks(of_tests.get(name)),
        )
        for name in names
    )
    output = read_at_most(folder / "output.txt", _MAX_OUTPUT_BYTES) or b""
    text = "\n".join((*(suite.output for suite in reported), output.decode(errors="replace")))
    text = cleaned_output(text).replace(f"{share}/", "")
    return Findings(*ending, tests, tuple(runs), text, callbacks(None))


def _process(run: Run | None) -> str | None:
    try:
        return (run.folder / PROCESS_FILE).read_text() if run else None
    except OSError:
        return None


def _runs_of(names: Sequence[str], written: dict[str, Path], runs: Sequence[Run]) -> dict[str, Run]:
    found = {name: run for name, path in written.items() for run in runs if _began(run) <= path.stat().st_mtime}
    left = (run for run in runs if run not in found.values())
    return {**dict(zip((name for name in names if name not in found), left, strict=False)), **found}


def _began(run: Run) -> float:
    try:
        return (run.folder / PROCESS_FILE).stat().st_mtime
    except OSError:
        return run.folder.stat().st_mtime
