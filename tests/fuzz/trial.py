"""Runs in a child process: what sim-action makes of damaged inputs.

    python -m tests.fuzz.trial FOLDER SHARE CASE...

Each CASE is KIND:SEED:NUMBER, or the name of an input of the corpus. A line of JSON is printed when a case begins, and
when it ends, with its fate and a list of what is wrong. SHARE of the cases also run as a whole command.
"""

from __future__ import annotations

import contextlib
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final
from unittest.mock import patch
from xml.etree import ElementTree as ET

from sim_action.cli.main import call
from sim_action.commands.controller_answers import answer_problem
from sim_action.commands.external_program import AnswerError, ProcessCommands, parse_answer
from sim_action.core.errors import InternalError, InvalidScenario, Problem
from sim_action.core.permissions import Permissions
from sim_action.core.workspace import Workspace
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model
from sim_action.scenario.files import read_file
from sim_action.scenario.loading import checked
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.source import Refused, Source
from sim_action.world import Physics, World
from sim_action.world.scene import Scene
from tests.fuzz.cases import ANSWERS, EXAMPLES, SCENARIO, Case, case
from tests.fuzz.corpus import CORPUS

MAX_CPU_S: Final = 20  # longest processor time in s of one trial in this process; a signal ends it then
MAX_S: Final = 200
"""Longest wall time in s of one trial; a busy machine is slow, so only what waits for ever reaches it."""
_MEMORY: Final = 6 << 30
_MAX_RUN_SIM_S: Final = 30.0
_MAX_STEPS: Final = 8_000
_MAX_MESSAGE: Final = 3_000
_MAX_RUNS: Final = 20


def named_case(name: str) -> Case:
    """Return the case of a name."""
    if name in CORPUS:
        return CORPUS[name]
    kind, seed, number = name.split(":")
    return case(kind, int(seed), int(number))


def trial(tried: Case, folder: Path, *, run: bool) -> tuple[str, list[str]]:
    """Return the fate of a case, and what is wrong with it; `run`: as a whole command, too."""
    scenario = written(tried, folder)
    found = read_file(scenario, Permissions())
    refused = [each for each in found if isinstance(each, Refused)]
    wrong = [text for each in refused for text in _bad_refusal(each.error, tried, folder)]
    loaded: list[LoadedScenario] = []
    for source in (each for each in found[:_MAX_RUNS] if isinstance(each, Source)):
        try:
            loaded.append(checked(source, Permissions(), evaluate=tried.kind != "scenario"))
        except InvalidScenario as error:
            refused.append(source.refused(error))
            wrong += _bad_refusal(error, tried, folder)
    if tried.kind == "process":
        wrong += _bad_answers(tried.files[ANSWERS])
    fate = "refused" if refused else "taken"
    if run and len(found) <= _MAX_RUNS and all(map(_is_safe, loaded)):
        wrong += _bad_run(scenario, {each.name for each in refused})
        fate += ", run"
    return fate, wrong


def written(tried: Case, folder: Path) -> Path:
    """Write the files of a case, and return its scenario."""
    if tried.folder:
        needed = {tried.folder, "commands"} if b"../" in tried.files[SCENARIO] else {tried.folder}
        for name in needed:
            shutil.copytree(EXAMPLES / name, folder / name)
        folder = folder / tried.folder
    for name, data in tried.files.items():
        (folder / name).write_bytes(data)
    return folder / SCENARIO


def _is_safe(loaded: LoadedScenario) -> bool:
    """Return True if a run is short, and runs no program but that of the trial."""
    scenario = loaded.scenario
    programs = [source for source in scenario.commands if isinstance(source, ProcessCommands)]
    ours = all(source.process == ("python3", "answer.py") for source in programs)
    no_ros = not any(type(source).__name__ in ("RosCommands", "Ros2Commands") for source in scenario.commands)
    steps = scenario.time_limit * scenario.physics.rate
    short = scenario.time_limit <= _MAX_RUN_SIM_S and steps < _MAX_STEPS
    return ours and no_ros and short and scenario.wall_limit is None and scenario.memory_limit is None


def _bad_refusal(error: Exception, tried: Case, folder: Path) -> Iterator[str]:
    if isinstance(error, InternalError):
        yield f"an internal error: {error}\n{error.details}"
        return
    problems = getattr(error, "problems", ())
    if not problems:
        yield f"a refusal without a problem: {error!r}"
    for problem in problems:
        yield from _bad_problem(problem, tried, folder)


def _bad_problem(problem: Problem, tried: Case, folder: Path) -> Iterator[str]:
    place, text = problem.location, str(problem)
    lines = {name: data.count(b"\n") + data.count(b"\r") + 1 for name, data in tried.files.items()}
    name = Path(place.file).name
    if place.line is None and "cannot be read" not in text:
        yield f"a problem without a line: {text[:500]}"
    if place.line is not None and name in tried.files and tried.victim == name and name == SCENARIO:
        more = sum(tried.files[name].count(end) for end in ("\u2028".encode(), "\u2029".encode(), "\x85".encode()))
        if not 1 <= place.line <= lines[name] + more:
            yield f"line {place.line} of {lines[name]}: {text[:500]}"
    # A model may be right, and not fit the scenario.
    is_claim = tried.kind in ("model", "mesh") and problem.message.startswith(("expect.", "robot: "))
    if tried.victim != SCENARIO and not is_claim and tried.victim not in text:
        yield f"the damaged file {tried.victim} is not named: {text[:500]}"
    if not problem.message.replace("\n", "").isprintable():
        yield f"a message that is not printable: {problem.message[:500]!r}"
    if len(problem.message) > _MAX_MESSAGE:
        yield f"a message of {len(problem.message)} characters: {problem.message[:500]}"


def _bad_answers(answers: bytes) -> Iterator[str]:
    robot, workspace = Robot(model="turtlebot3_burger"), Workspace(EXAMPLES, EXAMPLES)
    scene = Scene(robot, load_model(robot, workspace), World(), Physics(), workspace)
    for line in answers.split(b"\n"):
        try:
            answer = parse_answer(line)
        except AnswerError as error:
            if not str(error).isprintable() or len(str(error)) > _MAX_MESSAGE:
                yield f"an unprintable or long refusal of an answer: {str(error)[:500]!r}"
        else:
            answer_problem(answer, scene)


def _bad_run(scenario: Path, refused: set[str]) -> Iterator[str]:
    """Run a command on the scenario, and check its exit code and its reports."""
    folder = scenario.parent
    here = Path.cwd()
    os.chdir(folder)
    try:
        with Path(os.devnull).open("w") as quiet, contextlib.redirect_stdout(quiet), contextlib.redirect_stderr(quiet):
            code = call(["run", SCENARIO, "--jobs", "1", "-q", "--output-dir", "out"])
    finally:
        os.chdir(here)
    if code not in (0, 1, 2):
        yield f"the exit code of the run is {code}"
    if not (folder / "out" / "results.json").exists():
        yield f"the run left no results, with exit code {code}"
        return
    results = Results.read(folder / "out" / "results.json")
    tree = ET.parse(folder / "out" / "junit.xml").getroot()
    cases, outcomes = list(tree.iter("testcase")), results.outcomes
    if len(cases) < len(outcomes):
        yield f"JUnit has {len(cases)} cases of {len(outcomes)} scenarios"
    if code != results.exit_code:
        yield f"the exit code is {code}, that of the results is {results.exit_code}"
    for outcome in outcomes:
        yield from _bad_outcome(outcome, refused)


def _bad_outcome(outcome: Outcome, refused: set[str]) -> Iterator[str]:
    for failure in outcome.failures:
        if failure.kind == "internal":
            yield f"an internal error in the run: {failure.message}\n{failure.details}"
        if failure.kind in ("crash", "timeout", "memory"):
            yield f"the run ended in {failure.kind}: {failure.message[:500]}"
        if "Traceback" in failure.message:
            yield f"a traceback in a message: {failure.message[:500]}"
    if outcome.status == "passed" and outcome.name in refused:
        yield f"'{outcome.name}' was refused, and passed"


def main() -> None:
    """Try the cases."""
    told = os.fdopen(os.dup(1), "w", buffering=1)
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)
    if "FUZZ_LOUD" not in os.environ:
        os.dup2(quiet, 2)
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    folder, share, names = Path(sys.argv[1]), float(sys.argv[2]), sys.argv[3:]
    os.chdir(folder)
    with patch.dict(os.environ, {"XDG_CACHE_HOME": str(folder / "cache")}):
        for name in names:
            told.write(json.dumps(["begin", name]) + "\n")
            told.write(json.dumps(["end", name, *_tried(name, share)]) + "\n")
    told.flush()
    os._exit(0)


def _tried(name: str, share: float) -> tuple[Any, ...]:
    folder = Path(tempfile.mkdtemp(dir=Path.cwd()))
    # The folder of each case is a workspace of its own.
    (folder / ".git").mkdir()
    signal.alarm(MAX_S)
    signal.setitimer(signal.ITIMER_PROF, MAX_CPU_S)
    try:
        run = random.Random(name).random() < share
        return trial(named_case(name), folder, run=run)
    except BaseException:  # noqa: BLE001 - what it is, is for the caller to read
        return "raised", [traceback.format_exc()]
    finally:
        signal.alarm(0)
        signal.setitimer(signal.ITIMER_PROF, 0)
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main()
