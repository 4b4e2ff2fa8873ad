"""Child processes that run one scenario after the other: which runs share one, and how long."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

import pytest

from sim_action.core.permissions import Permissions
from sim_action.core.process import Interruption
from sim_action.runner.process_pool import execute
from sim_action.scenario.loading import load_scenario
from sim_action.scenario.model import LoadedScenario
from sim_action.simulation.loop import simulate

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="other systems share no processes"),
    pytest.mark.process,
]

SCENARIO = "robot: {model: turtlebot3_burger}\nphysics: {settle: 0}\nexpect: [upright]\ntime_limit: 0.1 s\n"
# This process, which is forked, may have mapped more than 4 GiB by now: other tests had threads.
LIMIT = "memory_limit: 1024 GiB\n"
BALL = '<body name="ball" pos="0 0 1"><freejoint/><geom name="g" size="0.1"/></body>'
SCRIPT = "def control(observation):\n    return None\n"


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


def test_runs_share_one_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scenarios = loaded(tmp_path, [""] * 4)
    assert forks(scenarios, tmp_path, monkeypatch) == 1
    assert forks(scenarios, tmp_path, monkeypatch, shares=False) == 4


def test_runs_share_as_many_processes_as_may_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert forks(loaded(tmp_path, [""] * 5), tmp_path, monkeypatch, jobs=2) == 2


def test_a_process_is_replaced_after_some_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sim_action.runner.isolation.shared_child.MAX_RUNS", 2)
    assert forks(loaded(tmp_path, [""] * 5), tmp_path, monkeypatch) == 3


def test_runs_with_different_memory_limits_share_no_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    other = LIMIT.replace("1024", "1025")
    limits = ["", other, other, ""]
    assert forks(loaded(tmp_path, limits), tmp_path, monkeypatch) == 3


def test_repeats_share_no_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert forks(loaded(tmp_path, [""]), tmp_path, monkeypatch, repeat=2) == 0


def test_runs_with_user_code_share_no_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "c.py").write_text(SCRIPT)
    scenarios = loaded(tmp_path, ["", "commands: {script: c.py}\n", "commands: {script: c.py}\n", ""])
    # Each script has an interpreter of its own, and takes the place of a process that waits.
    assert forks(scenarios, tmp_path, monkeypatch) == 2


def test_runs_that_update_golden_files_share_no_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scenarios = loaded(tmp_path, [""] * 2, Permissions(updates_golden=True))
    assert forks(scenarios, tmp_path, monkeypatch) == 2


def test_models_that_only_a_child_reads_share_no_process_with_other_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("mujoco")
    (tmp_path / "ball.xml").write_text(f"<mujoco><worldbody>{BALL}</worldbody></mujoco>")
    text = SCENARIO.replace("turtlebot3_burger", "ball.xml").replace("[upright]", "[{max_speed: {linear: 50}}]")
    found = []
    for name in "ab":
        (tmp_path / f"{name}.sim.yml").write_text(f"name: {name}\nbackend: mujoco\n{LIMIT}{text}")
        found.append(load_scenario(tmp_path / f"{name}.sim.yml"))
    assert found[0].model is None
    assert forks([found[0], found[0], found[1]], tmp_path, monkeypatch) == 2


class MallocInfo(ctypes.Structure):
    """What mallinfo2(3) returns."""

    _fields_: ClassVar = [
        *((name, ctypes.c_size_t) for name in ("arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks")),
        *((name, ctypes.c_size_t) for name in ("uordblks", "fordblks", "keepcost")),
    ]


def free_heap() -> int:
    """The bytes of all free blocks of this process's heap."""
    mallinfo2 = ctypes.CDLL(None).mallinfo2
    mallinfo2.restype = MallocInfo
    return int(mallinfo2().fordblks)


def test_the_first_run_of_a_process_reaches_its_memory_limit_where_a_run_alone_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def greedy(*arguments: Any) -> object:
        import resource

        mapped = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        limits = resource.getrlimit(resource.RLIMIT_AS)
        # Earlier tests may have left free blocks in the heap: both of these are larger.
        free = free_heap()
        size, other = free + (60 << 20), free + (1 << 20)
        resource.setrlimit(resource.RLIMIT_AS, (mapped + size + other + size // 2, limits[1]))
        # A mapped block grows in place, which the heap cannot do below another block.
        grows, _other = bytearray(size), bytearray(other)
        grows.extend(bytes(1 << 20))
        del grows
        resource.setrlimit(resource.RLIMIT_AS, limits)
        return simulate(*arguments)

    monkeypatch.setattr("sim_action.runner.child_main.simulate", greedy)
    assert forks(loaded(tmp_path, [""] * 2), tmp_path, monkeypatch) == 2
