"""The pool of child processes, with children that start no process."""

from __future__ import annotations

import socket
from itertools import count
from pathlib import Path
from typing import ClassVar, Self

import pytest

from sim_action.core.process import Interruption
from sim_action.results.outcome import Outcome
from sim_action.runner.isolation.child_process import ChildProcess
from sim_action.runner.job import Job
from sim_action.runner.process_pool import execute
from sim_action.scenario.loading import load_scenario

SCENARIO = "name: {name}\nrobot: {{model: turtlebot3_burger}}\nexpect: [upright]\ntime_limit: 1 s\n"


class Waiting(ChildProcess):
    """A child that ends once all later ones have ended; the first one gives up after a hundred looks."""

    forks = False
    limits_memory = False
    ended: ClassVar[list[str]] = []
    looks: ClassVar[int] = 0

    def __init__(self, job: Job) -> None:
        self.own, self.other = socket.socketpair()
        self.own.setblocking(False)
        self.other.send(b"0.5\n")
        super().__init__(job, self.own)

    @classmethod
    def start(cls, job: Job) -> Self:
        return cls(job)

    def poll(self) -> int | None:
        type(self).looks += 1
        assert self.looks < 100
        number = int(self.job.loaded.scenario.name)
        return 0 if len(self.ended) == 2 - number else None

    def kill(self) -> None: ...

    def close(self) -> None:
        self.ended.append(self.job.loaded.scenario.name)
        self.own.close()
        self.other.close()

    def _heard(self) -> bytes:
        return self.own.recv(100)


class Listener:
    def __init__(self) -> None:
        self.told: list[str] = []

    def progress(self, name: str, sim_time: float, real_time_factor: float) -> None:
        assert sim_time == 0.5
        assert real_time_factor > 0
        self.told.append(f"{name} goes on")

    def finished(self, outcome: Outcome) -> None:
        self.told.append(f"{outcome.name} is done")


def test_each_child_is_looked_at_while_those_before_it_still_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Waiting, "ended", [])
    monkeypatch.setattr(Waiting, "looks", 0)
    loaded = []
    for name in "012":
        (tmp_path / f"{name}.sim.yml").write_text(SCENARIO.format(name=f"'{name}'"))
        loaded.append(load_scenario(tmp_path / f"{name}.sim.yml"))
    listener = Listener()
    with Interruption() as interruption:
        outcomes = execute(loaded, tmp_path, 3, listener, interruption, child_type=Waiting)
    assert [outcome.name for outcome in outcomes] == ["0", "1", "2"]
    assert Waiting.ended == ["2", "1", "0"]
    assert [told for told in listener.told if told.endswith("done")] == ["2 is done", "1 is done", "0 is done"]
    assert listener.told[:3] == ["0 goes on", "1 goes on", "2 is done"]


class InterruptedAtLook(Interruption):
    """An interruption that happens right before the pool looks for it the n-th time."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self._looks, self._number = count(1), number

    @property
    def happened(self) -> bool:
        return next(self._looks) >= self._number

    @happened.setter
    def happened(self, value: bool) -> None:
        assert not value, "no signal arrives in these tests"


class Ended(Waiting):
    """A child that has ended when the pool first looks."""

    def poll(self) -> int | None:
        return 0


@pytest.mark.parametrize("number", range(1, 12))
def test_an_interruption_at_any_moment_leaves_an_outcome_for_each_scenario(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    monkeypatch.setattr(Waiting, "ended", [])
    loaded = []
    for name in ("a", "b", "c"):
        (tmp_path / f"{name}.sim.yml").write_text(SCENARIO.format(name=name))
        loaded.append(load_scenario(tmp_path / f"{name}.sim.yml"))
    with InterruptedAtLook(number) as interruption:
        outcomes = execute(loaded, tmp_path, 1, Listener(), interruption, child_type=Ended)
    assert [outcome.name for outcome in outcomes] == ["a", "b", "c"]
