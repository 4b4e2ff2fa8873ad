"""No model or scenario opens a file outside the workspace. Each opened file is traced, in all processes of a run."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Final

import pytest

import sim_action
from sim_action.engines import installed
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from tests.integration.conftest import write
from tests.integration.faults.injection import COMPILER
from tests.integration.faults.tracing import Traced, compiled, traced
from tests.integration.hostile_files import CASES, NORMAL, SENTINEL, Case, scenario, write_cases

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="the tracer needs LD_PRELOAD, which is a feature of Linux"),
    pytest.mark.skipif(COMPILER is None, reason="no C compiler compiles the tracer"),
    pytest.mark.skipif("mujoco" not in installed(), reason="MJCF is read by MuJoCo, which is not installed"),
]

PRIVILEGED: Final = {"GITHUB_EVENT_NAME": "pull_request_target"}

SCRIPTS: Final = ("--allow-scripts", "true", "--pass-env", "LD_PRELOAD", "--pass-env", "OPENED_FILES")
"""Options with which scripts run, and are traced: they see few variables of the environment."""

NEVER: Final = ("/etc/passwd", "/dev/zero", "/proc/N/environ")  # files of the system that the hostile models name


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compiled(tmp_path_factory.mktemp("tracer"))


def below(path: str, *folders: Path) -> bool:
    return any(Path(path).is_relative_to(folder) for folder in folders)


class Suite:
    """A suite that has run, with all files that it opened."""

    def __init__(self, root: Path, library: Path, cases: tuple[Case, ...]) -> None:
        self.root, self.workspace = root, write_cases(root, cases)
        self.run = self.call(library, "run")
        results = Results.read(self.workspace / "sim-results/results.json")
        self.outcomes = {Path(outcome.file).parent.name: outcome for outcome in results.outcomes}

    def call(self, library: Path, command: str) -> Traced:
        """Call the command line for all scenarios."""
        temp, cache = self.root / "temp", self.root / "cache"
        temp.mkdir(exist_ok=True)
        own = {"TMPDIR": str(temp), "XDG_CACHE_HOME": str(cache)}
        return traced(self.workspace, library, {**PRIVILEGED, **own}, "-m", "sim_action", command, ".")

    def foreign(self, run: Traced) -> set[str]:
        """Return the opened files that are neither in the workspace nor a part of an installed program."""
        own = [self.workspace, self.root / "temp", self.root / "cache", Path(sim_action.__file__).parent]
        # ROS, if it is installed, starts the Python of the system.
        places = (*sys.path, sys.prefix, sys.base_prefix, "/usr", "/opt/ros")
        installed = {Path(place).resolve() for place in places if place}
        return {
            re.sub(r"\d+", "N", path)
            for path in run.opened
            if not below(path, *own, *installed) and not path.startswith("/etc/python")
        }


@pytest.fixture(scope="module")
def hostile(library: Path, tmp_path_factory: pytest.TempPathFactory) -> Suite:
    return Suite(tmp_path_factory.mktemp("hostile"), library, CASES)


@pytest.fixture(scope="module")
def normal(library: Path, tmp_path_factory: pytest.TempPathFactory) -> Suite:
    return Suite(tmp_path_factory.mktemp("normal"), library, NORMAL)


def test_the_tracer_sees_what_a_script_opens(library: Path, tmp_path: Path) -> None:
    """A control: it sees what it must see."""
    outside, folder = write(tmp_path / "outside.txt", SENTINEL), tmp_path / "inside"
    write(folder / "c.py", "def control(observation):\n    open('link.txt').read()\n")
    write(folder / "s.sim.yml", scenario(Case("s", "", "", scenario={"commands": {"script": "c.py", "rate": "10 Hz"}})))
    (folder / "link.txt").symlink_to(outside)
    run = traced(folder, library, PRIVILEGED, "-m", "sim_action", "run", ".", *SCRIPTS)
    assert run.code == 0, run.printed
    assert str(outside) in run.opened


def test_normal_models_run(normal: Suite) -> None:
    statuses = {case.name: normal.outcomes[case.folder].status for case in NORMAL}
    assert set(statuses.values()) == {"passed"}, statuses
    assert not {*NEVER} & normal.foreign(normal.run)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_hostile_model_is_an_error_with_its_file_and_line(case: Case, hostile: Suite) -> None:
    outcome: Outcome = hostile.outcomes[case.folder]
    if not case.message:
        assert outcome.status == "passed", outcome
        return
    assert outcome.status == "error", outcome
    failure = outcome.failures[0]
    assert case.message in failure.message
    assert "\n" not in failure.message
    assert failure.message.isprintable()
    assert failure.location is not None
    assert f"{failure.location.file}:{failure.location.line}" == f"{case.folder}/{case.place}"


@pytest.mark.parametrize("command", ["run", "validate"])
def test_no_file_outside_is_opened(command: str, hostile: Suite, normal: Suite, library: Path) -> None:
    run = hostile.run if command == "run" else hostile.call(library, command)
    assert run.code == 2, run.printed
    assert not [path for path in run.opened if below(path, hostile.root / "outside", hostile.workspace / ".git")]
    # What is opened besides is what any run opens.
    assert hostile.foreign(run) - normal.foreign(normal.run) == set()
    assert SENTINEL not in run.printed


def test_a_link_to_a_scenario_or_to_settings_is_not_opened(library: Path, tmp_path: Path) -> None:
    inside, outside = tmp_path / "inside", tmp_path / "outside"
    for folder in (inside / ".git", outside / ".git"):
        folder.mkdir(parents=True)
    (inside / "linked").symlink_to(outside)
    write(outside / "t.sim.yml", f"name: {SENTINEL}\n")
    for name in ("s.sim.yml", "pyproject.toml"):
        (outside / name).write_text(f"[tool.sim-action]\n{SENTINEL} = 1\n")
        (inside / name).symlink_to(outside / name)
    run = traced(inside, library, PRIVILEGED, "-m", "sim_action", "run", ".", "linked", "lin*/t*.yml")
    assert run.code == 2, run.printed
    assert run.printed.count(f"outside the workspace {inside}; allow it with --allow-outside") == 3
    assert not [path for path in run.opened if below(path, outside)]
    assert SENTINEL not in run.printed


def test_nothing_of_a_file_outside_is_in_a_report(hostile: Suite) -> None:
    reports = [path for path in (hostile.workspace / "sim-results").rglob("*") if path.is_file()]
    assert {"results.json", "junit.xml"} <= {path.name for path in reports}
    assert not [path.name for path in reports if SENTINEL.encode() in path.read_bytes()]
