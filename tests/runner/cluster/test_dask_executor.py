"""The runs of a call on a cluster that a test plays: workers that die, and tasks that Dask gives to another one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from distributed import KilledWorker

from sim_action.core.errors import UsageError
from sim_action.core.process import Interruption
from sim_action.results.journal import Event, RunEnded, Started
from sim_action.results.outcome import Outcome
from sim_action.runner.cluster import dask_executor
from sim_action.runner.cluster.address import ClusterAddress
from sim_action.runner.cluster.dask_executor import Batches, ClusterRuns
from sim_action.runner.cluster.dask_worker import Reply
from sim_action.runner.cluster.task import Result
from sim_action.runner.run_plan import Runs
from tests.scenarios import load

SCENARIO = "name: falls\nrobot: {model: turtlebot3_burger}\nexpect: [upright]\ntime_limit: 1 s\n"

Played = Callable[["Cluster", str, tuple[int, ...]], Reply | BaseException | None]
"""Plays a task, by its key and the indices of its runs: its end, or None, after which it is cancelled."""


class Future:
    def __init__(self, key: str, end: Reply | BaseException | None) -> None:
        self.key, self.end = key, end

    def result(self) -> Reply:
        assert self.end is not None
        if isinstance(self.end, BaseException):
            raise self.end
        return self.end

    def add_done_callback(self, hear: Callable[[Any], None]) -> None:
        if self.end is not None:
            hear(self)


class Cluster:
    """A connection to one worker with one thread, and what was submitted."""

    def __init__(self, play: Played) -> None:
        self.play = play
        self.submitted: list[tuple[int, ...]] = []
        self.cancelled: list[str] = []

    def nthreads(self) -> dict[str, int]:
        return {"one": 1}

    def subscribe_topic(self, _topic: str, hear: Callable[[Any], None]) -> None:
        self.hear = hear

    def unsubscribe_topic(self, _topic: str) -> None: ...

    def begin(self, key: str, index: int, worker: str) -> None:
        self.hear((0.0, (key, index, worker, None)))

    def submit(self, _function: object, indices: tuple[int, ...], _topic: str, *, pure: bool) -> Future:
        assert not pure
        self.submitted.append(indices)
        key = f"task {len(self.submitted)}"
        return Future(key, self.play(self, key, indices))

    def cancel(self, futures: Sequence[Future], *, force: bool) -> None:
        assert force
        self.cancelled += [future.key for future in futures]


def passed(indices: Sequence[int]) -> Reply:
    outcome = Outcome(name="falls", file="falls.sim.yml", status="passed", wall_time=0.01)
    return Reply("one", tuple(Result(outcome.model_dump_json()) for _ in indices))


def outcomes(folder: Path, count: int, play: Played) -> tuple[list[Outcome], Cluster, list[Event]]:
    """The outcomes of a call whose runs are so short that they may all share a task."""
    scenarios = [load(folder, SCENARIO)] * count
    batches = Batches(range(count), ["one workspace"] * count)
    batches.took([0.01])
    cluster, events = Cluster(play), list[Event]()
    client: Any = cluster
    task: Any = tuple
    with Interruption() as interruption:
        runs = ClusterRuns(
            Runs(scenarios, folder),
            events.append,
            interruption,
            client,
            task=task,
            send=lambda _: None,
            batches=batches,
        )
        return runs.outcomes(), cluster, events


def places(events: Sequence[Event], kind: type[Started | RunEnded]) -> list[int]:
    return [event.place for event in events if isinstance(event, kind)]


def test_runs_of_a_worker_that_died_run_again_alone_and_count_once(tmp_path: Path) -> None:
    def play(cluster: Cluster, key: str, indices: tuple[int, ...]) -> Reply | None:
        if len(indices) == 1:
            return passed(indices)
        for index in indices[:2]:
            cluster.begin(key, index, "one")
        cluster.begin(key, indices[0], "another")
        return None

    found, cluster, events = outcomes(tmp_path, 4, play)
    assert [outcome.status for outcome in found] == ["passed"] * 4
    assert cluster.submitted == [(0, 1, 2, 3), (0,), (1,), (2,), (3,)]
    assert cluster.cancelled == ["task 1"]
    assert sorted(places(events, Started)) == sorted(places(events, RunEnded)) == [0, 1, 2, 3]


def test_the_death_of_a_batch_counts_for_the_run_that_it_had_begun_last(tmp_path: Path) -> None:
    def play(cluster: Cluster, key: str, indices: tuple[int, ...]) -> Reply | BaseException | None:
        if len(indices) > 1:
            for index in indices[:2]:
                cluster.begin(key, index, "first")
            return KilledWorker(key, Mock(), 0)
        if indices == (1,):
            for worker in ("second", "third", "fourth"):
                cluster.begin(key, 1, worker)
            return None
        cluster.begin(key, indices[0], "last")
        return passed(indices)

    found, _, events = outcomes(tmp_path, 3, play)
    assert [found[index].status for index in range(3)] == ["passed", "error", "passed"]
    [failure] = found[1].failures
    assert "3 workers died while running this scenario, the last one at third" in failure.message
    assert sorted(places(events, Started)) == sorted(places(events, RunEnded)) == [0, 1, 2]


def test_a_batch_that_cannot_be_run_is_split_and_only_one_run_is_refused(tmp_path: Path) -> None:
    def play(_cluster: Cluster, _key: str, indices: tuple[int, ...]) -> Reply:
        return Reply("one", refusal="no space is left") if 1 in indices else passed(indices)

    found, _, _ = outcomes(tmp_path, 3, play)
    assert [found[index].status for index in range(3)] == ["passed", "error", "passed"]
    assert "the worker one cannot run it: no space is left" in found[1].failures[0].message


def test_a_batch_is_sent_again_with_the_workspace_that_its_worker_lacks(tmp_path: Path) -> None:
    def play(cluster: Cluster, _key: str, indices: tuple[int, ...]) -> Reply:
        return passed(indices) if len(cluster.submitted) > 1 else Reply("one", lacks=("digest",))

    found, cluster, _ = outcomes(tmp_path, 3, play)
    assert len(found) == 3
    assert cluster.submitted == [(0, 1, 2)] * 2


def test_a_worker_that_lacks_its_workspace_for_ever_is_an_error_of_each_run(tmp_path: Path) -> None:
    found, cluster, _ = outcomes(tmp_path, 2, lambda *_: Reply("one", lacks=("digest",)))
    assert all("has lost the workspace again and again" in found[index].failures[0].message for index in range(2))
    assert len(cluster.submitted) < 20


def taken(batches: Batches, threads: int) -> list[int]:
    sizes = []
    while batches:
        sizes.append(len(batches.take(threads)))
    return sizes


def of(count: int) -> Batches:
    return Batches(range(count), ["one workspace"] * count)


def test_the_size_of_batches() -> None:
    assert of(100).take(2) == (0,)
    # Short runs come together and fewer at the end.
    batches = of(100)
    batches.took([0.0625, 0.125])
    assert taken(batches, 2) == [16, 16, 16, 13, 9, 7, 5, 4, 3, 3, 3, 3, 2]
    # A batch takes no longer than a few seconds.
    batches = of(1000)
    batches.took([1.0])
    assert batches.take(2) == (0, 1, 2)
    batches.took([60.0, 1.0])
    assert batches.take(2) == (3,)
    # Runs of no time are bounded too.
    batches = of(1000)
    batches.took([0.0])
    assert len(batches.take(2)) == 16


def test_batches_of_kinds_and_runs_that_are_put_back() -> None:
    # Runs of other kinds are not mixed.
    batches = Batches(range(8), ["a", "a", "b", "b", "b", None, None, "b"])
    batches.took([0.01])
    assert [batches.take(1) for _ in range(5)] == [(0, 1), (2, 3, 4), (5,), (6,), (7,)]
    # Runs of a batch without result are alone the next time.
    batches = of(9)
    batches.took([0.1])
    first = batches.take(1)
    assert len(first) > 1
    batches.put_back_alone(first)
    assert [batches.take(1) for _ in first] == [(index,) for index in first]
    assert len(batches.take(1)) > 1
    # Runs that are put back come first and last.
    batches = of(3)
    first = batches.take(1)
    batches.put_last(first[0])
    second = batches.take(1)
    batches.put_back(second)
    assert len(batches) == 3
    assert batches.clear() == (1, 2, 0)
    assert not batches


def test_a_cluster_that_cannot_be_closed_in_time_loses_no_outcome(monkeypatch: pytest.MonkeyPatch) -> None:
    cluster, client = (Mock(**{"close.side_effect": TimeoutError}) for _ in range(2))
    monkeypatch.setattr(dask_executor, "LocalCluster", Mock(return_value=cluster))
    monkeypatch.setattr(dask_executor, "Client", Mock(return_value=client))
    with ExitStack() as stack:
        assert dask_executor._client(ClusterAddress.parse("local:2"), stack) is client
    client.close.assert_called_once_with()
    cluster.close.assert_called_once_with()


def test_workers_that_do_not_start_are_a_problem_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dask_executor, "LocalCluster", Mock(side_effect=RuntimeError("Nanny failed to start.")))
    with ExitStack() as stack, pytest.raises(UsageError, match=r"the workers of local:2 did not start \(Nanny failed"):
        dask_executor._client(ClusterAddress.parse("local:2"), stack)
