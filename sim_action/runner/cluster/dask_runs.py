"""The runs of one call on a cluster: what is submitted, what comes back, and the outcome of each run."""

from __future__ import annotations

import queue
import socket
import time
import uuid
from collections import Counter, deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from distributed import Client, Future, KilledWorker

from sim_action.core.errors import UsageError
from sim_action.core.files import whole_file
from sim_action.core.process import Interruption
from sim_action.core.records import dataclass
from sim_action.core.wording import counted, escaped_line
from sim_action.results.events import Listener, Progressed, RunEnded, Started
from sim_action.results.outcome import Failure, Outcome
from sim_action.runner.child_outcome import without_verdict
from sim_action.runner.cluster.dask_worker import Reply, perform
from sim_action.runner.cluster.task import Result, Task
from sim_action.runner.job import JobOrder

_MAX_WAIT_S: Final = 0.5
_WORKERS_PERIOD_S: Final = 1.0
_NO_WORKER_TIMEOUT_S: Final = 60.0
_MOST_DEATHS: Final = 3
_MOST_TIMES_AGAIN: Final = 6

_Report = tuple[int, str, tuple[float, float] | None]
"""The index of a run, the address of its worker, and its sim time and real time factor; None: it begins."""


@dataclass(frozen=True, slots=True)
class _Answer:
    """The end of a run, as a thread of Dask has heard of it."""

    index: int
    reply: Reply | None
    error: BaseException | None


class ClusterRuns:
    """The scheduler of one call: it submits runs, hears of them from the threads of Dask, and places the outcomes."""

    def __init__(
        self,
        client: Client,
        *,
        order: JobOrder,
        task: Callable[[int], Task],
        send: Callable[[Reply], None],
        numbered: Sequence[tuple[int, int]],
        emit: Listener,
        interruption: Interruption,
        waiting: deque[int],
        fail_fast: bool,
    ) -> None:
        """Take the runs of a call.

        Args:
            client: the connection to the scheduler.
            order: makes their jobs.
            task: returns the task of a run, by its index.
            send: sends a worker the workspaces that it lacks; it raises UsageError.
            numbered: the place and the turn of each run.
            emit: receives the events of the runs.
            interruption: ends the call early.
            waiting: the indices of the runs to submit.
            fail_fast: start no run after the first one that has not passed.
        """
        self._client, self._send = client, send
        self._order, self._task, self._numbered = order, task, numbered
        self._emit, self._interruption, self._fail_fast = emit, interruption, fail_fast
        self._waiting = waiting
        self._running: dict[int, Future[Reply]] = {}
        self._outcomes: dict[int, Outcome] = {}
        # The workers on which a run has begun, and how often it was given to Dask again without that.
        self._begun: dict[int, list[str]] = {}
        self._again: Counter[int] = Counter()
        self._answers: queue.SimpleQueue[_Answer | _Report] = queue.SimpleQueue()
        self._threads = self._threads_now()
        self._looked_at = self._last_worker_at = time.monotonic()
        self._topic = f"sim-action-{uuid.uuid4()}"

    def outcomes(self, meanwhile: Callable[[], object]) -> dict[int, Outcome]:
        """Return outcomes by index; runs that did not start or end have none."""
        self._wakened, self._waker = socket.socketpair()
        self._waker.setblocking(False)
        self._wakened.setblocking(False)
        self._client.subscribe_topic(self._topic, self._progressed)
        try:
            self._submit()
            with suppress(OSError, ImportError):
                meanwhile()
            while (self._running or self._waiting) and not self._interruption.happened:
                self._interruption.wait(_MAX_WAIT_S, self._wakened)
                self._collect()
                self._look_at_workers()
                self._submit()
        finally:
            with suppress(Exception):
                self._client.cancel(list(self._running.values()), force=True)
                self._client.unsubscribe_topic(self._topic)
            self._waker.close()
            self._wakened.close()
        return self._outcomes

    def _submit(self) -> None:
        """Give Dask a run for each thread, and another one that waits there: no worker waits for this process then."""
        while self._waiting and len(self._running) < 2 * self._threads and not self._interruption.happened:
            index = self._waiting.popleft()
            future = self._client.submit(perform, self._task(index), self._topic, pure=False)
            self._running[index] = future
            future.add_done_callback(lambda done, index=index: self._heard(index, done))

    def _heard(self, index: int, done: Future[Reply]) -> None:
        """Take the answer of a run; called in a thread of Dask."""
        reply, error = None, None
        try:
            reply = done.result()
        except BaseException as raised:  # noqa: BLE001 - the other thread judges it
            error = raised
        self._tell(_Answer(index, reply, error))

    def _progressed(self, event: tuple[Any, _Report]) -> None:
        """Take a report of a running task; called in a thread of Dask."""
        self._tell(event[1])

    def _tell(self, told: _Answer | _Report) -> None:
        self._answers.put(told)
        # It is full: the other thread wakes anyway. It is closed: nobody waits any more.
        with suppress(OSError):
            self._waker.send(b"\0")

    def _collect(self) -> None:
        with suppress(BlockingIOError):
            self._wakened.recv(4096)
        while not self._answers.empty():
            told = self._answers.get()
            if isinstance(told, _Answer):
                if self._running.pop(told.index, None) is not None:
                    self._judge(told)
            else:
                index, worker, progress = told
                if progress is None:
                    self._begin(index, worker)
                elif index in self._running:
                    self._emit(Progressed(*self._numbered[index], self._name(index), *progress))

    def _begin(self, index: int, worker: str = "unknown") -> None:
        self._begun.setdefault(index, []).append(worker)
        if len(self._begun[index]) == 1:
            self._emit(Started(*self._numbered[index], self._name(index)))

    def _name(self, index: int) -> str:
        return self._order.scenarios[index % len(self._order.scenarios)].scenario.name

    def _judge(self, answer: _Answer) -> None:
        """Place the outcome of a run, or give it to Dask again."""
        index, reply = answer.index, answer.reply
        dead = self._begun.get(index, [])
        is_last = self._again[index] >= _MOST_TIMES_AGAIN
        is_killed = isinstance(answer.error, KilledWorker)
        if (is_killed and dead) or (reply is not None and reply.lacks and len(dead) >= _MOST_DEATHS):
            self._finish(index, self._error(index, _killed(dead)))
        elif is_killed and not is_last:
            # Another run has killed the workers; this one waited there.
            self._again[index] += 1
            self._waiting.append(index)
        elif reply is None:
            self._finish(index, self._error(index, str(answer.error or "the cluster has given it up")))
        elif reply.lacks and not is_last:
            self._again[index] += 1
            try:
                self._send(reply)
            except UsageError as error:
                self._finish(index, self._error(index, str(error)))
            else:
                self._waiting.appendleft(index)
        elif reply.result is None:
            reason = reply.refusal or "it has lost the workspace again and again"
            self._finish(index, self._error(index, f"the worker {reply.worker} cannot run it: {reason}"))
        else:
            self._finish(index, self._placed(index, reply.result))

    def _placed(self, index: int, result: Result) -> Outcome:
        """Write the files of a run, and return its outcome with their names."""
        job = self._order.job(index)
        for number, content in result.files:
            path = job.evidence[number]
            path.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(path) as file:
                file.write(content)
        outcome = Outcome.model_validate_json(result.outcome)
        endings = {Path(name).suffix for name in outcome.recordings}
        return outcome.model_copy(
            update={
                "trace": job.trace_name if outcome.trace else None,
                "replay": job.named(job.replay) if job.replay and outcome.replay else None,
                "recordings": tuple(job.named(path) for path in job.recordings if path.suffix in endings),
            }
        )

    def _error(self, index: int, cause: str) -> Outcome:
        failure = Failure(kind="crash", title="cluster", message=escaped_line(cause))
        return without_verdict(self._order.job(index).loaded, failure)

    def _finish(self, index: int, outcome: Outcome) -> None:
        if index not in self._begun:
            self._begin(index)
        self._outcomes[index] = outcome
        self._emit(RunEnded(*self._numbered[index], outcome))
        if self._fail_fast and outcome.status != "passed":
            self._waiting.clear()
            not_begun = [each for each in self._running if each not in self._begun]
            self._client.cancel([self._running.pop(each) for each in not_begun], force=True)

    def _look_at_workers(self) -> None:
        """Use workers that came, and give up without any."""
        if (now := time.monotonic()) - self._looked_at < _WORKERS_PERIOD_S:
            return
        self._looked_at = now
        try:
            self._threads = self._threads_now()
        except Exception as error:  # noqa: BLE001 - Dask raises what its streams raise
            self._give_up(f"the connection to the cluster is lost: {error}")
            return
        if self._threads:
            self._last_worker_at = now
        elif now - self._last_worker_at >= _NO_WORKER_TIMEOUT_S:
            self._give_up(f"the cluster has had no worker for {_NO_WORKER_TIMEOUT_S:g} s")

    def _threads_now(self) -> int:
        return sum(self._client.nthreads().values())

    def _give_up(self, cause: str) -> None:
        left = [*self._running, *self._waiting]
        self._waiting.clear()
        for index in left:
            self._running.pop(index, None)
            self._finish(index, self._error(index, cause))


def _killed(workers: Sequence[str]) -> str:
    """Return the cause of an error; `workers`: the addresses of those that died while they ran a scenario."""
    *_, last = workers
    return (
        f"{counted(len(workers), 'worker')} died while running this scenario, the last one at {last}; it may need more "
        "memory than they have, and the log of the worker may say more"
    )
