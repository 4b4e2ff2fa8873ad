"""Runs that share a child process have the outcomes of child processes of their own, killers among them."""

from __future__ import annotations

import errno
import faulthandler
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import product
from pathlib import Path
from typing import Any, Final, NoReturn

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import EngineError, SimulationUnstable
from sim_action.core.permissions import Permissions
from sim_action.core.process import Interruption
from sim_action.engines import chosen, installed
from sim_action.results.journal import Event, Progressed, RunEnded, Started
from sim_action.results.outcome import Outcome
from sim_action.runner import child_main
from sim_action.runner.run_plan import engine_runs
from sim_action.scenario.files import read_file
from sim_action.scenario.loading import load_all, load_scenario
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.source import Refused
from sim_action.simulation import loop
from tests.examples import EXAMPLES
from tests.pool import execute
from tests.soak import examples, soaked

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="other systems share no processes"),
    pytest.mark.filterwarnings("default::RuntimeWarning"),
]

ROOT: Final = Path(__file__).parents[2]
SCENARIO: Final = """\
name: {name}
robot: {{model: turtlebot3_burger}}
backend: {engine}
physics: {{settle: 0}}
commands: {{twist: [{{linear: {speed}}}]}}
expect: [{{travel: {{at_least: 1 cm}}}}]
time_limit: 0.2 s
output_limit: 1 MB
memory_limit: {memory} GiB
wall_limit: {wall} s
"""
ENGINES: Final = installed()
Act = Callable[[], object]


def crash() -> None:
    os.write(1, b"last words\n")
    # That of pytest would write to its terminal.
    faulthandler.disable()
    os.kill(os.getpid(), signal.SIGSEGV)


def flood() -> NoReturn:
    # Whatever the moment of its end, the end of its output is the same.
    while True:
        os.write(1, (b"f" * 63 + b"\n") * 1000)


def raising(error: type[Exception], *arguments: object) -> Act:
    def act() -> NoReturn:
        raise error(*arguments)

    return act


def show(message: object, *_: object, **__: object) -> None:
    sys.stderr.write(f"{message}\n")


def warn() -> None:
    # That of pytest keeps them.
    warnings.showwarning = show
    warnings.warn("once at each line", RuntimeWarning, stacklevel=1)


def talk() -> None:
    os.write(2, b"mujoco warning: the same in each run\n")
    sys.stdout.write("printed")


LEFT: Final[list[object]] = []


def leave_files_open() -> None:
    with suppress(OSError):
        while True:
            LEFT.append(os.open(os.devnull, os.O_RDONLY))


def leave_traces() -> None:
    """Change what a process has once."""
    np.random.seed(len(LEFT))  # noqa: NPY002 - the state that is shared
    Path(tempfile.gettempdir(), "left").touch()


ACTS: Final[Mapping[str, Act]] = {
    "be honest": lambda: None,
    "crash": crash,
    "hang": lambda: time.sleep(600),
    "flood": flood,
    "hog": lambda: bytearray(1 << 40),
    "leave": lambda: os._exit(3),
    "refuse files": raising(OSError, errno.EMFILE, os.strerror(errno.EMFILE)),
    "be unstable": raising(SimulationUnstable, "it flies away"),
    "give up": raising(EngineError, "the engine gave up"),
    "have a fault": raising(KeyError, "a fault of sim-action"),
    "warn": warn,
    "talk": talk,
    "leave memory": lambda: LEFT.append(bytearray(200 << 20)),
    "leave files open": leave_files_open,
    "leave traces": leave_traces,
}
"""What runs do inside of sim-action's own code: no scenario without user code can be made to do most of it."""


@pytest.fixture(scope="module", autouse=True)
def acting() -> Iterator[None]:
    """Let each run do, before its simulation, what its name says; forked processes inherit this."""
    simulate = loop.simulate

    def acted(scenario: Any, *arguments: Any) -> Any:
        ACTS.get(scenario.name.partition(" - ")[0], ACTS["be honest"])()
        return simulate(scenario, *arguments)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(child_main, "simulate", acted)
        # The thread with which a worker of pytest-xdist hears of more tests counts from its first message on.
        patch.setattr(threading, "active_count", lambda: 1)
        yield


def suite(folder: Path, acts: Sequence[tuple[str, str, float, int]]) -> list[LoadedScenario]:
    """Return a scenario for each act, engine, speed and memory limit in GiB."""
    loaded = []
    for number, (act, engine, speed, memory) in enumerate(acts):
        path = folder / f"{number}.sim.yml"
        # Only a killer may depend on how long it takes.
        wall = 0.5 if act == "hang" else 60
        name = f"{act} - {number}"
        path.write_text(SCENARIO.format(name=name, engine=engine, speed=speed, memory=memory, wall=wall))
        loaded.append(load_scenario(path))
    return loaded


class Listener:
    """Keeps the events, and does something at one of them."""

    def __init__(self, act: Callable[[Event], None] = lambda _: None) -> None:
        self.events: list[Event] = []
        self._act = act

    def __call__(self, event: Event) -> None:
        self.events.append(event)
        self._act(event)

    def places(self, kind: type[Started | RunEnded]) -> list[int]:
        return [event.place for event in self.events if isinstance(event, kind)]


def run(
    loaded: Sequence[LoadedScenario], folder: Path, listener: Listener, *, jobs: int = 2, **options: Any
) -> list[Outcome]:
    with Interruption() as interruption:
        return execute(loaded, folder, jobs, listener, interruption, **options)


def content(outcome: Outcome, *others: str) -> dict[str, Any]:
    """An outcome without times and `others`: everything that must not depend on how it was run."""
    return outcome.model_dump(mode="json", exclude={"wall_time", "real_time_factor", *others})


ACTIONS: Final = st.tuples(
    st.one_of(st.just("be honest"), st.sampled_from(sorted(ACTS))),
    st.sampled_from(ENGINES),
    st.sampled_from((0.1, 0.2, 0.3)),
    st.sampled_from((4, 4, 3)),
)


@examples(2)
@given(acts=st.lists(ACTIONS, min_size=2, max_size=8), jobs=st.integers(1, 2))
def test_runs_that_share_processes_have_the_outcomes_of_runs_alone(
    tmp_path_factory: pytest.TempPathFactory, acts: list[tuple[str, str, float, int]], jobs: int
) -> None:
    folder = tmp_path_factory.mktemp("suite")
    loaded, listener = suite(folder, acts), Listener()
    alone = run(loaded, folder / "alone", Listener(), jobs=2, shares=False, replays=True)
    shared = run(loaded, folder / "shared", listener, jobs=jobs, replays=True)
    assert list(map(content, shared)) == list(map(content, alone))
    assert sorted(listener.places(Started)) == sorted(listener.places(RunEnded)) == list(range(len(acts)))
    traces = [sorted(path.name for path in (folder / name).rglob("*.npz")) for name in ("alone", "shared")]
    assert traces[0] == traces[1]


def test_each_act_costs_no_other_run_anything(tmp_path: Path) -> None:
    quiet = ("warn", "talk", "leave traces")
    names = [*(each for act in sorted(ACTS) for each in ("be honest", act)), *quiet, *quiet]
    loaded = suite(tmp_path, [(name, ENGINES[0], 0.2, 4) for name in names])
    alone = run(loaded, tmp_path / "alone", Listener(), shares=False)
    shared = run(loaded, tmp_path / "shared", Listener(), jobs=1)
    assert list(map(content, shared)) == list(map(content, alone))
    found = {outcome.name.partition(" - ")[0]: outcome for outcome in shared}
    assert {act: found[act].failures[0].kind for act in KINDS} == KINDS
    assert {act for act in found if found[act].status == "error"} == {*KINDS, "leave files open"}
    assert found["warn"].output.count("once at each line") == 1
    assert found["talk"].output == "printed"
    assert [each.message for each in found["talk"].diagnostics] == ["the same in each run"]


KINDS: Final = {
    "crash": "crash",
    "hang": "wall limit",
    "flood": "crash",
    "hog": "memory",
    "leave": "crash",
    "refuse files": "crash",
    "be unstable": "unstable",
    "give up": "engine",
    "have a fault": "internal",
}


PRINTING: Final = """\
import ctypes
import sys
from pathlib import Path

from tests.integration.test_shared_children import ENGINES, Listener, run, suite

folder = Path(sys.argv[1])
loaded = suite(folder, [("be honest", ENGINES[0], 0.2, 4)] * 3)
ctypes.CDLL(None).printf(b"not of a run\\n")
outcomes = run(loaded, folder, Listener(), jobs=1)
sys.stderr.write(repr([outcome.output for outcome in outcomes]))
"""


def test_what_native_code_printed_before_the_runs_belongs_to_none(tmp_path: Path) -> None:
    # Only without this variable, C keeps printed output in a buffer.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    command = [sys.executable, "-c", PRINTING, str(tmp_path)]
    found = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
    assert found.stdout == "not of a run\n"
    assert found.stderr.splitlines()[-1] == repr([""] * 3)


def children() -> set[int]:
    return set(map(int, Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()))


@examples(2)
@given(number=st.integers(1, 12), kind=st.sampled_from((Started, Progressed, RunEnded)), jobs=st.integers(1, 2))
def test_a_process_that_is_killed_from_outside_costs_no_verdict_of_another_run(
    tmp_path_factory: pytest.TempPathFactory, number: int, kind: type[Event], jobs: int
) -> None:
    folder = tmp_path_factory.mktemp("suite")
    loaded = suite(folder, [("be honest", ENGINES[0], speed, 4) for speed in (0.1, 0.2, 0.3, 0.1, 0.2, 0.3)])
    alone = run(loaded, folder / "alone", Listener(), shares=False)
    others, killed = children(), set[int]()

    def kill(_: Event) -> None:
        count = sum(isinstance(event, kind) for event in listener.events)
        if count == number and not killed and (born := children() - others):
            killed.add(min(born))
            os.kill(min(born), signal.SIGKILL)

    listener = Listener(kill)
    shared = run(loaded, folder / "shared", listener, jobs=jobs)
    pairs = enumerate(zip(shared, alone, strict=True))
    differ = [index for index, (one, other) in pairs if content(one) != content(other)]
    # The first run of a process has the cause that a child process of its own has.
    assert len(differ) <= len(killed)
    assert all(shared[index].failures[0].title == "SIGKILL" for index in differ)
    assert children() == others


def test_with_fail_fast_a_run_that_is_repeated_has_its_own_outcome(tmp_path: Path) -> None:
    acts = [(each, ENGINES[0], 0.2, 4) for each in ("be honest", "crash", "be honest")]
    loaded = suite(tmp_path, acts)
    shared = run(loaded, tmp_path / "shared", Listener(), jobs=1, fail_fast=True)
    assert [outcome.status for outcome in shared] == ["passed", "error", "skipped"]


def examples_without_code(engine: str, every: int) -> list[LoadedScenario]:
    """The examples without user code that run on this engine; of all files, each `every`-th."""
    sources = [source for path in EXAMPLES[::every] for source in read_file(path, Permissions())]
    loaded = [each for each in load_all(sources, Permissions()) if not isinstance(each, Refused)]
    runs = [each for one in loaded if not one.scenario.runs_user_code for each in engine_runs(one, "all")]
    return [each for each in runs if chosen(each.scenario.backend) == engine]


@pytest.mark.parametrize(("engine", "every"), soaked(list(product(ENGINES, (1, 24))), product(ENGINES, (24,))))
def test_examples_have_the_same_digests_in_a_process_that_has_run_others(
    tmp_path: Path, engine: str, every: int
) -> None:
    loaded = examples_without_code(engine, every)
    assert len(loaded) > 2
    alone = run(loaded, tmp_path / "alone", Listener(), shares=False, replays=True)
    # Each follows all others.
    shared = run(loaded * 2, tmp_path / "shared", Listener(), jobs=1, replays=True)
    expected = [content(outcome, "trace", "replay") for outcome in alone]
    for outcomes in (shared[: len(loaded)], shared[len(loaded) :]):
        assert [content(outcome, "trace", "replay") for outcome in outcomes] == expected
    assert {outcome.status for outcome in alone} == {"passed"}
    assert None not in {outcome.digest for outcome in alone}
