"""Child processes that run one scenario after the other: which runs share one, and how long."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from sim_action.core.permissions import Permissions
from sim_action.core.process import Interruption
from sim_action.runner.job import Job
from sim_action.scenario.loading import load_scenario
from sim_action.scenario.model import LoadedScenario
from sim_action.simulation.loop import simulate
from tests.pool import execute

if sys.platform == "linux":
    from sim_action.runner.isolation import linux_child
    from sim_action.runner.isolation.preloaded_interpreter import PreloadedInterpreter

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="other systems share no processes"),
    pytest.mark.process,
]

SCENARIO = "robot: {model: turtlebot3_burger}\nphysics: {settle: 0}\nexpect: [upright]\ntime_limit: 0.1 s\n"
# This process, which is forked, may have mapped more than 4 GiB by now: other tests had threads.
LIMIT = "memory_limit: 1024 GiB\n"
BALL = '<body name="ball" pos="0 0 1"><freejoint/><geom name="g" size="0.1"/></body>'


def loaded(folder: Path, keys: Sequence[str], permissions: Permissions = Permissions()) -> list[LoadedScenario]:  # noqa: B008
    found = []
    for number, more in enumerate(keys):
        path = folder / f"{number}.sim.yml"
        limit = "" if "memory_limit" in more else LIMIT
        path.write_text(f"name: n{number}\n{SCENARIO}{limit}{more}")
        found.append(load_scenario(path, permissions))
    return found


def forks(
    scenarios: Sequence[LoadedScenario], folder: Path, monkeypatch: pytest.MonkeyPatch, jobs: int = 1, **options: Any
) -> int:
    """Run the scenarios, which pass; return how often this process was forked."""
    fork = os.fork
    count: list[None] = []

    def counted() -> int:
        count.append(None)
        return fork()

    monkeypatch.setattr(os, "fork", counted)
    with Interruption() as interruption:
        outcomes = execute(scenarios, folder / "results", jobs, lambda _: None, interruption, **options)
    assert [outcome.failures for outcome in outcomes] == [()] * len(outcomes)
    return len(count)


def test_runs_share_processes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Runs share one process.
    scenarios = loaded(tmp_path, [""] * 4)
    assert forks(scenarios, tmp_path, monkeypatch) == 1
    assert forks(scenarios, tmp_path, monkeypatch, shares=False) == 4
    assert forks(loaded(tmp_path, [""] * 5), tmp_path, monkeypatch, jobs=2) == 2


def test_a_process_is_replaced_after_some_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sim_action.runner.isolation.linux_child.MAX_RUNS", 2)
    assert forks(loaded(tmp_path, [""] * 5), tmp_path, monkeypatch) == 3


@pytest.mark.parametrize("error", [OSError, MemoryError])
def test_a_process_that_takes_no_other_run_is_ended_and_replaced(
    error: type[Exception], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ended: list[int] = []
    end = linux_child.SharedChild.end

    def noted(child: linux_child.SharedChild) -> None:
        ended.append(child._pid)
        end(child)

    monkeypatch.setattr(linux_child.SharedChild, "next", Mock(side_effect=error))
    monkeypatch.setattr(linux_child.SharedChild, "end", noted)
    assert forks(loaded(tmp_path, [""] * 2), tmp_path, monkeypatch) == 2
    assert len(set(ended)) == 2


def test_runs_that_share_no_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Runs with different memory limits share no process.
    other = LIMIT.replace("1024", "1025")
    limits = ["", other, other, ""]
    assert forks(loaded(tmp_path, limits), tmp_path, monkeypatch) == 3
    assert forks(loaded(tmp_path, [""]), tmp_path, monkeypatch, repeat=2) == 0


ALONE = """\
import json
assert not hasattr(json, "former")
json.former = True
def control(observation):
    return None
"""


def on(route: str) -> str:
    return f"environment: {{ROUTE: {route}}}\n"


@pytest.mark.parametrize(
    ("more", "killed", "expected"),
    [
        ([""] * 2, False, (1, 0)),
        (["", on("north")] * 2, False, (2, 0)),
        ([*map(on, "abc"), *map(on, "cba")], False, (2, 2)),
        ([""] * 2, True, (1, 2)),
    ],
    ids=["alike", "environments", "many environments", "killed"],
)
def test_runs_with_user_code_share_an_interpreter_without_their_traces(
    more: Sequence[str], killed: bool, expected: tuple[int, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[str] = []
    begin, spawn = PreloadedInterpreter.__init__, linux_child._spawn

    def counted(interpreter: PreloadedInterpreter, *arguments: Any) -> None:
        started.append("interpreter")
        begin(interpreter, *arguments)
        if killed:
            interpreter._process.kill()

    def spawned(*arguments: Any) -> int:
        started.append("spawned")
        return spawn(*arguments)

    monkeypatch.setattr(PreloadedInterpreter, "__init__", counted)
    monkeypatch.setattr(linux_child, "_spawn", spawned)
    monkeypatch.setattr(linux_child, "_MOST_INTERPRETERS", 2)
    (tmp_path / "c.py").write_text(ALONE)
    scenarios = loaded(tmp_path, ["", *(f"commands: {{script: c.py}}\n{each}" for each in more), ""])
    # Those without user code are forks of this process; the first of them ends before a script begins.
    assert forks(scenarios, tmp_path, monkeypatch) == 2
    assert (started.count("interpreter"), started.count("spawned")) == expected


def test_a_run_that_its_interpreter_does_not_fork_can_be_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    begin = PreloadedInterpreter.__init__

    def stopped(interpreter: PreloadedInterpreter, *arguments: Any) -> None:
        begin(interpreter, *arguments)
        interpreter._process.send_signal(signal.SIGSTOP)

    monkeypatch.setattr(PreloadedInterpreter, "__init__", stopped)
    (tmp_path / "c.py").write_text(ALONE)
    [run] = loaded(tmp_path, ["commands: {script: c.py}\n"])
    starter = linux_child.SharingStarter(lambda _: Job(run, tmp_path / "t.npz", tmp_path))
    children = [starter.start(0, Job(run, tmp_path / "t.npz", tmp_path), alone=False, most_waiting=0) for _ in "ab"]
    assert [child.poll() for child in children] == [None, None]
    first = children[0]
    assert isinstance(first, linux_child.LinuxChild)
    for line in (b"forked 7", b"forked 8"):  # user code may write the second one
        first._take(line)
    assert first._pid == 7
    first._pid = 0
    for child in children:
        child.kill()
        child.close()
        assert child.is_doubtful
    starter.end_waiting()


def test_runs_that_update_golden_files_share_no_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scenarios = loaded(tmp_path, [""] * 2, Permissions(updates_golden=True))
    assert forks(scenarios, tmp_path, monkeypatch) == 2


def test_models_that_only_a_child_reads_share_no_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mujoco")
    (tmp_path / "ball.xml").write_text(f"<mujoco><worldbody>{BALL}</worldbody></mujoco>")
    text = SCENARIO.replace("turtlebot3_burger", "ball.xml").replace("[upright]", "[{max_speed: {linear: 50}}]")
    found = []
    for name in "ab":
        (tmp_path / f"{name}.sim.yml").write_text(f"name: {name}\nbackend: mujoco\n{LIMIT}{text}")
        found.append(load_scenario(tmp_path / f"{name}.sim.yml"))
    assert found[0].model is None
    assert forks([found[0], found[0], found[1]], tmp_path, monkeypatch) == 2


def greedy(*arguments: Any) -> object:
    """Let a large block grow, which its memory limit allows only outside the heap; then simulate."""
    import resource

    mapped = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    limits = resource.getrlimit(resource.RLIMIT_AS)
    size = 60 << 20
    resource.setrlimit(resource.RLIMIT_AS, (mapped + size + size // 2, limits[1]))
    # A mapped block grows in place, which the heap cannot do below another block.
    grows, _other = bytearray(size), bytearray(1 << 20)
    grows.extend(bytes(1 << 20))
    del grows
    resource.setrlimit(resource.RLIMIT_AS, limits)
    return simulate(*arguments)


def count_forks_of_greedy_runs(folder: Path) -> int:
    """Return how many processes two runs take that let a block grow."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr("sim_action.runner.child_main.simulate", greedy)
        return forks(loaded(folder, [""] * 2), folder, monkeypatch)


def test_the_first_run_of_a_process_reaches_its_memory_limit_where_a_run_alone_does(tmp_path: Path) -> None:
    # The heap of this process has free blocks of other tests, in which a block may grow: a new process has few.
    code = f"from {__name__} import count_forks_of_greedy_runs as count, Path; print(count(Path({str(tmp_path)!r})))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "2\n"
