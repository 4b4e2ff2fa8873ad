"""The pool of child processes, with children that start no process."""

from __future__ import annotations

import errno
import gc
import os
import socket
import sys
from collections.abc import Sequence
from itertools import count
from pathlib import Path
from typing import ClassVar, Self
from unittest.mock import Mock

import pytest

from sim_action.core.process import Interruption
from sim_action.results.journal import Event, Progressed, RunEnded
from sim_action.results.outcome import Outcome
from sim_action.runner.isolation.child_process import ChildProcess
from sim_action.runner.job import Job
from sim_action.scenario.loading import load_scenario
from sim_action.scenario.model import LoadedScenario
from tests.pool import execute

SCENARIO = "name: '{name}'\nrobot: {{model: turtlebot3_burger}}\nexpect: [upright]\ntime_limit: 1 s\n"


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

    def __call__(self, event: Event) -> None:
        if isinstance(event, Progressed):
            assert event.sim_time == 0.5
            assert event.real_time_factor > 0
            self.told.append(f"{event.name} goes on")
        if isinstance(event, RunEnded):
            self.told.append(f"{event.outcome.name} is done")


def test_each_child_is_looked_at_while_earlier_ones_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Waiting, "ended", [])
    monkeypatch.setattr(Waiting, "looks", 0)
    listener = Listener()
    with Interruption() as interruption:
        outcomes = execute(loaded(tmp_path, "012"), tmp_path, 3, listener, interruption, child_type=Waiting)
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
def test_an_interruption_leaves_each_an_outcome(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    monkeypatch.setattr(Waiting, "ended", [])
    with InterruptedAtLook(number) as interruption:
        outcomes = execute(loaded(tmp_path, "abc"), tmp_path, 1, Listener(), interruption, child_type=Ended)
    assert [outcome.name for outcome in outcomes] == ["a", "b", "c"]


class Refused(Ended):
    """A child that the system does not always start: `script` holds the answers, None for a start.

    After the last answer, the system repeats it.
    """

    script: ClassVar[list[BaseException | None]] = []
    together: ClassVar[int] = 0
    most: ClassVar[int] = 0

    @classmethod
    def start(cls, job: Job) -> Self:
        answer = cls.script.pop(0) if len(cls.script) > 1 else cls.script[0]
        if answer is not None:
            raise answer
        cls.together += 1
        cls.most = max(cls.most, cls.together)
        return cls(job)

    def close(self) -> None:
        type(self).together -= 1
        super().close()


class Patient(Interruption):
    """An interruption that never happens, and that only counts waits without a child."""

    def __init__(self) -> None:
        super().__init__()
        self.pauses = 0

    def wait(self, seconds: float, *readable: int | socket.socket) -> None:
        self.pauses += not readable
        super().wait(0, *readable)


def refusal(number: int) -> OSError:
    return OSError(number, os.strerror(number))


def started(
    folder: Path, names: str, script: Sequence[BaseException | None], monkeypatch: pytest.MonkeyPatch, jobs: int = 3
) -> tuple[list[Outcome], int]:
    """Return the outcomes of a run whose children start as `script` says, and the number of pauses."""
    for name, value in (("ended", []), ("script", list(script)), ("together", 0), ("most", 0)):
        monkeypatch.setattr(Refused, name, value)
    with Patient() as patient:
        outcomes = execute(loaded(folder, names), folder, jobs, Listener(), patient, child_type=Refused)
    assert [outcome.name for outcome in outcomes] == list(names)
    assert Refused.together == 0
    return outcomes, patient.pauses


def loaded(folder: Path, names: str) -> list[LoadedScenario]:
    for name in names:
        (folder / f"{name}.sim.yml").write_text(SCENARIO.format(name=name))
    return [load_scenario(folder / f"{name}.sim.yml") for name in names]


def titles(outcomes: Sequence[Outcome]) -> list[str]:
    return [failure.title for outcome in outcomes for failure in outcome.failures]


@pytest.mark.parametrize("error", [refusal(errno.EMFILE), refusal(errno.EAGAIN), MemoryError()])
def test_a_refused_start_waits_for_an_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    outcomes, pauses = started(tmp_path, "abcdef", [None, None, error, None], monkeypatch)
    assert titles(outcomes) == ["exit code 0"] * 6 or "not started" not in titles(outcomes)
    assert (Refused.most, pauses) == (2, 0)
    assert Refused.ended == list("abcdef")


def test_a_refused_start_is_tried_again_after_a_pause(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    outcomes, pauses = started(tmp_path, "ab", [refusal(errno.EAGAIN)] * 3 + [None], monkeypatch)
    assert "not started" not in titles(outcomes)
    assert pauses == 3


def test_scenarios_that_never_start_are_errors_with_the_cause(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    outcomes, pauses = started(tmp_path, "abcd", [None, refusal(errno.ENOSPC)], monkeypatch)
    assert titles(outcomes)[1:] == ["not started"] * 3
    assert {outcome.exit_code for outcome in outcomes} == {1}
    message = outcomes[1].failures[0].message
    assert message.startswith("the process of this scenario could not be started: no space left on device; free some")
    # Where one could not start, the others need not wait as long.
    assert pauses == 4


def test_a_scenario_starts_although_the_one_before_could_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    outcomes, _ = started(tmp_path, "ab", [*[refusal(errno.EMFILE)] * 5, None], monkeypatch)
    assert titles(outcomes)[0] == "not started"
    assert Refused.ended == ["b"]


def test_with_fail_fast_a_scenario_that_cannot_start_is_last(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Refused, "script", [refusal(errno.EMFILE)])
    with Patient() as patient:
        outcomes = execute(
            loaded(tmp_path, "abc"), tmp_path, 2, Listener(), patient, child_type=Refused, fail_fast=True
        )
    assert [outcome.status for outcome in outcomes] == ["error", "skipped", "skipped"]


class RefusedInside(Refused):
    """A child that starts, and then cannot begin: `script` holds what each child reports."""

    refusals: ClassVar[list[bytes]] = []

    def __init__(self, job: Job) -> None:
        super().__init__(job)
        self.other.send(self.refusals.pop(0) if len(self.refusals) > 1 else self.refusals[0])


REFUSED = b"refused %d\n" % errno.EAGAIN


def test_a_child_that_cannot_begin_starts_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (("ended", []), ("script", [None]), ("refusals", [b"", REFUSED, REFUSED, b""])):
        monkeypatch.setattr(RefusedInside, name, value)
    with Patient() as patient:
        outcomes = execute(loaded(tmp_path, "abc"), tmp_path, 3, Listener(), patient, child_type=RefusedInside)
    assert "not started" not in titles(outcomes)
    assert sorted(RefusedInside.ended) == list("abbcc")


@pytest.mark.parametrize("fail_fast", [False, True])
def test_a_child_without_begin_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fail_fast: bool) -> None:
    for name, value in (("ended", []), ("script", [None]), ("refusals", [b"", REFUSED])):
        monkeypatch.setattr(RefusedInside, name, value)
    with Patient() as patient:
        outcomes = execute(
            loaded(tmp_path, "abc"), tmp_path, 3, Listener(), patient, child_type=RefusedInside, fail_fast=fail_fast
        )
    assert [outcome.status for outcome in outcomes] == ["error", *["skipped" if fail_fast else "error"] * 2]
    assert titles(outcomes)[1:] == ([] if fail_fast else ["not started"] * 2)


SCRIPTED = "commands: {script: c.py}\n"


def descriptors() -> set[str]:
    return set(os.listdir("/proc/self/fd"))  # noqa: PTH208 - of numbers


@pytest.mark.skipif(sys.platform != "linux", reason="a fork, and what stands for it, are for Linux")
@pytest.mark.parametrize(("refused", "keys"), [("os.fork", ""), ("subprocess.Popen", SCRIPTED)])
def test_a_start_that_fails_half_way_leaves_nothing_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: str, keys: str
) -> None:
    from sim_action.runner.isolation.linux_child import LinuxChild

    (tmp_path / "c.py").write_text("def control(observation):\n    return None\n")
    (tmp_path / "a.sim.yml").write_text(SCENARIO.format(name="a") + keys)
    scenarios = [load_scenario(tmp_path / "a.sim.yml")]
    monkeypatch.setattr(refused, Mock(side_effect=refusal(errno.EAGAIN)))
    with Patient() as patient:
        before = descriptors()
        (outcome,) = execute(scenarios, tmp_path, 2, Listener(), patient, child_type=LinuxChild)
        assert descriptors() == before
    assert titles([outcome]) == ["not started"]
    assert gc.get_freeze_count() == 0


@pytest.mark.parametrize("error", [refusal(errno.EMFILE), ImportError("cannot open shared object file")])
def test_refused_preparations_cost_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    monkeypatch.setattr(Waiting, "ended", [])
    with Patient() as patient:
        execute(
            loaded(tmp_path, "ab"),
            tmp_path,
            2,
            Listener(),
            patient,
            child_type=Ended,
            meanwhile=Mock(side_effect=error),
        )
    assert Waiting.ended == ["a", "b"]


class Forking(Ended):
    """A child that could be a fork of this process."""

    forks = True
    seeds: ClassVar[list[int | None]] = []

    @classmethod
    def start(cls, job: Job) -> Self:
        cls.seeds.append(job.hash_seed)
        return super().start(job)


@pytest.mark.parametrize(
    ("error", "seeds"),
    [
        (None, [None, None]),
        (refusal(errno.EMFILE), [0, 0]),
        (ImportError("cannot open shared object file"), [0, 0]),
        (MemoryError(), [0, 0]),
    ],
)
def test_without_preparation_each_scenario_gets_an_interpreter_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception | None, seeds: list[int | None]
) -> None:
    monkeypatch.setattr(Waiting, "ended", [])
    monkeypatch.setattr(Forking, "seeds", [])
    monkeypatch.setattr("sim_action.runner.process_pool.warm_up", Mock(side_effect=error))
    with Patient() as patient:
        execute(loaded(tmp_path, "ab"), tmp_path, 2, Listener(), patient, child_type=Forking)
    assert Forking.seeds == seeds
    assert Waiting.ended == ["a", "b"]


def test_an_interruption_ends_the_attempts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Refused, "script", [refusal(errno.EMFILE)])
    with InterruptedAtLook(4) as interruption:
        monkeypatch.setattr(interruption, "wait", Mock())
        outcomes = execute(loaded(tmp_path, "ab"), tmp_path, 2, Listener(), interruption, child_type=Refused)
    assert [outcome.failures[0].kind for outcome in outcomes] == ["interrupted"] * 2


def test_there_are_no_more_children_than_the_limits_allow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sim_action.runner.process_pool.most_children", lambda _, jobs: jobs // 3)
    started(tmp_path, "abcdef", [None], monkeypatch, jobs=6)
    assert Refused.most == 2
