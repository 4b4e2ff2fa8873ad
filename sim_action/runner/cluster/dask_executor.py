"""The executor on a cluster of Dask: it takes the place of `process_pool.Pool`."""

from __future__ import annotations

import logging
import queue
import socket
import tempfile
import time
import uuid
import warnings
from collections import Counter, deque
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, Final

import dask.config
from distributed import Client, Future, KilledWorker, LocalCluster
from typing_extensions import override

from sim_action.core.errors import UsageError
from sim_action.core.files import whole_file
from sim_action.core.permissions import Permissions
from sim_action.core.process import Interruption
from sim_action.core.records import dataclass, field
from sim_action.core.wording import counted, escaped_line, note, system_reason
from sim_action.engines import chosen
from sim_action.results.journal import Listener, Progressed
from sim_action.results.outcome import Failure, Outcome
from sim_action.runner.child_outcome import without_verdict
from sim_action.runner.cluster.address import ClusterAddress
from sim_action.runner.cluster.dask_worker import Reply, Report, perform, receive
from sim_action.runner.cluster.task import Output, Result, Run, Software, Task, software
from sim_action.runner.cluster.workspace_archive import Archive, archive_of
from sim_action.runner.run_plan import Runs, Scheduler
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.watched_files import NamedFiles

_LONGEST_S: Final = 3.0
"""The time that a batch may take: so late may its outcomes come, and so much work may be lost with a worker."""

_SHORTEST_S: Final = 0.3  # the time that is not worth another start, even if a worker then waits for others at the end
_MOST_RUNS: Final = 16
_PARTS: Final = 2  # a batch has at most 1 / _PARTS of the runs left for each thread: the workers end together


class Batches:
    """The runs that wait for a worker."""

    def __init__(self, waiting: Iterable[int], kinds: Sequence[Hashable | None]) -> None:
        """Take the indices of runs, and the kind of each run: equal kinds may share a batch, None is always alone."""
        self._waiting = deque(waiting)
        self._kinds = kinds
        self._alone: set[int] = set()
        # Nothing is known of the first runs.
        self._seconds = _LONGEST_S

    def __len__(self) -> int:
        return len(self._waiting)

    def take(self, threads: int) -> tuple[int, ...]:
        """Return the next runs for one of so many threads of workers."""
        fair = max(len(self._waiting) // (_PARTS * max(1, threads)), int(_SHORTEST_S / self._seconds))
        most = min(_MOST_RUNS, int(_LONGEST_S / self._seconds), fair)
        taken = [self._waiting.popleft()]
        kind = self._kind(taken[0])
        while kind is not None and len(taken) < most and self._waiting and self._kind(self._waiting[0]) == kind:
            taken.append(self._waiting.popleft())
        return tuple(taken)

    def _kind(self, index: int) -> Hashable | None:
        return None if index in self._alone else self._kinds[index]

    def took(self, seconds: Sequence[float]) -> None:
        """Take the times of the runs of a batch, to estimate the times of others."""
        self._seconds = max(1e-3, sum(seconds) / len(seconds))

    def put_back(self, indices: Sequence[int]) -> None:
        """Take runs that must start again, before all others."""
        self._waiting.extendleft(reversed(indices))

    def put_back_alone(self, indices: Sequence[int]) -> None:
        """Take runs of a batch that has no result: one of them may be the reason, and each gets a task of its own."""
        self._alone.update(indices)
        self.put_back(indices)

    def put_last(self, index: int) -> None:
        """Take a run that must start again, after all others."""
        self._waiting.append(index)

    def clear(self) -> tuple[int, ...]:
        """Return all runs; none waits any more."""
        left = tuple(self._waiting)
        self._waiting.clear()
        return left


_MAX_WAIT_S: Final = 0.5
_WORKERS_PERIOD_S: Final = 1.0
_NO_WORKER_TIMEOUT_S: Final = 60.0
_MOST_DEATHS: Final = 3
_MOST_TIMES_AGAIN: Final = 6


@dataclass(frozen=True, eq=False)
class _Submitted:
    """A task of Dask, with the indices of its runs and of the runs that have begun."""

    indices: tuple[int, ...]
    future: Future[Reply]
    begun: list[int] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class _Answer:
    """The end of a task, by its key, as a thread of Dask has heard of it."""

    task: str
    reply: Reply | None
    error: BaseException | None


class ClusterRuns(Scheduler):
    """Submits the runs of a call, hears of them from the threads of Dask, and places the outcomes."""

    def __init__(
        self,
        runs: Runs,
        emit: Listener,
        interruption: Interruption,
        client: Client,
        *,
        task: Callable[[Sequence[int]], Task],
        send: Callable[[Reply], None],
        batches: Batches,
    ) -> None:
        """Take the runs of a call.

        Args:
            runs: the runs.
            emit: receives their events.
            interruption: ends the call early.
            client: the connection to the scheduler.
            task: returns the task of runs, by their indices.
            send: sends a worker the workspaces that it lacks; it raises UsageError.
            batches: the runs to submit.
        """
        super().__init__(runs, emit, interruption)
        self._client, self._send, self._task, self._batches = client, send, task, batches
        # By their keys at Dask.
        self._tasks: dict[str, _Submitted] = {}
        # The workers on which a run has begun, and how often it was given to Dask again without that.
        self._begun: dict[int, list[str]] = {}
        self._again: Counter[int] = Counter()
        self._answers: queue.SimpleQueue[_Answer | Report] = queue.SimpleQueue()
        self._threads = self._threads_now()
        self._looked_at = self._last_worker_at = time.monotonic()
        self._topic = f"sim-action-{uuid.uuid4()}"

    @override
    def _run(self, meanwhile: Callable[[], object]) -> None:
        self._wakened, self._waker = socket.socketpair()
        self._waker.setblocking(False)
        self._wakened.setblocking(False)
        self._client.subscribe_topic(self._topic, self._progressed)
        try:
            self._submit()
            with suppress(OSError, ImportError):
                meanwhile()
            while (self._tasks or self._batches) and not self._interruption.happened:
                self._interruption.wait(_MAX_WAIT_S, self._wakened)
                self._collect()
                self._look_at_workers()
                self._submit()
        finally:
            with suppress(Exception):
                self._cancel(tuple(self._tasks.values()))
                self._client.unsubscribe_topic(self._topic)
            self._waker.close()
            self._wakened.close()

    def _submit(self) -> None:
        """Give Dask a task for each thread, and another one that waits there: no worker waits for this process then."""
        while self._batches and len(self._tasks) < 2 * self._threads and not self._interruption.happened:
            taken = self._batches.take(self._threads)
            indices = tuple(index for index in taken if not self._is_needless(index))
            if not indices:
                continue
            task = _Submitted(indices, self._client.submit(perform, self._task(indices), self._topic, pure=False))
            self._tasks[str(task.future.key)] = task
            task.future.add_done_callback(self._heard)

    def _cancel(self, tasks: Collection[_Submitted]) -> None:
        self._client.cancel([task.future for task in tasks], force=True)
        for task in tasks:
            del self._tasks[str(task.future.key)]

    def _heard(self, done: Future[Reply]) -> None:
        """Take the answer of a task; called in a thread of Dask."""
        reply, error = None, None
        try:
            reply = done.result()
        except BaseException as raised:  # noqa: BLE001 - the other thread judges it
            error = raised
        self._tell(_Answer(str(done.key), reply, error))

    def _progressed(self, event: tuple[Any, tuple[Any, ...]]) -> None:
        self._tell(Report(*event[1]))

    def _tell(self, message: _Answer | Report) -> None:
        self._answers.put(message)
        # It is full: the other thread wakes anyway. It is closed: no thread waits any more.
        with suppress(OSError):
            self._waker.send(b"\0")

    def _collect(self) -> None:
        with suppress(BlockingIOError):
            self._wakened.recv(4096)
        while not self._answers.empty():
            message = self._answers.get()
            task = self._tasks.get(message.task)
            if task is None:
                # It was cancelled.
                continue
            if isinstance(message, Report):
                self._hear(task, message.index, message.worker, message.progress)
            else:
                del self._tasks[message.task]
                self._judge(task, message.reply, message.error)

    def _hear(self, task: _Submitted, index: int, worker: str, progress: tuple[float, float] | None) -> None:
        if progress is not None:
            self._emit(Progressed(*self._runs.place_and_turn(index), self._runs.name(index), *progress))
        elif index in task.begun and len(task.indices) > 1:
            # Its worker has died, and Dask has given the whole task to another one.
            self._cancel([task])
            self._split(task)
        elif len(dead := self._begun.get(index, [])) >= _MOST_DEATHS:
            self._cancel([task])
            self._finish(index, self._error(index, _killed(dead)))
        else:
            task.begun.append(index)
            self._begun.setdefault(index, []).append(worker)
            self._start(index)

    def _split(self, task: _Submitted) -> None:
        # These have ended: the worker has died while it ran the next one.
        for index in task.begun[:-1]:
            self._begun[index].pop()
        self._batches.put_back_alone(task.indices)

    def _judge(self, task: _Submitted, reply: Reply | None, error: BaseException | None) -> None:
        """Place the outcomes of a task, or give its runs to Dask again."""
        if reply is not None and reply.results:
            placed = [self._placed(*pair) for pair in zip(task.indices, reply.results, strict=True)]
            self._batches.took([outcome.wall_time or 0.0 for outcome in placed])
            for index, outcome in zip(task.indices, placed, strict=True):
                self._finish(index, outcome)
        elif (
            reply is not None and reply.lacks and max(self._again[index] for index in task.indices) < _MOST_TIMES_AGAIN
        ):
            self._again.update(task.indices)
            self._send_missing(task, reply)
        elif len(task.indices) > 1:
            self._split(task)
        else:
            self._judge_one(task.indices[0], reply, error)

    def _send_missing(self, task: _Submitted, reply: Reply) -> None:
        """Send a worker what it lacks for a task, and give the task to Dask again."""
        try:
            self._send(reply)
        except UsageError as error:
            for index in task.indices:
                self._finish(index, self._error(index, str(error)))
        else:
            self._batches.put_back(task.indices)

    def _judge_one(self, index: int, reply: Reply | None, error: BaseException | None) -> None:
        """Judge a run without a result that had a task of its own."""
        dead = self._begun.get(index, [])
        is_killed = isinstance(error, KilledWorker)
        if (is_killed and dead) or (reply is not None and reply.lacks and len(dead) >= _MOST_DEATHS):
            self._finish(index, self._error(index, _killed(dead)))
        elif is_killed and self._again[index] < _MOST_TIMES_AGAIN:
            # Another run has killed the workers; this one waited there.
            self._again[index] += 1
            self._batches.put_last(index)
        elif reply is None:
            self._finish(index, self._error(index, str(error or "the cluster has given it up")))
        else:
            reason = reply.refusal or "it has lost the workspace again and again"
            self._finish(index, self._error(index, f"the worker {reply.worker} cannot run it: {reason}"))

    def _placed(self, index: int, result: Result) -> Outcome:
        """Write the files of a run, and return its outcome with their names."""
        job = self._runs.job(index)
        outcome = Outcome.model_validate_json(result.outcome)
        notes = list(outcome.notes)
        for number, content in result.files:
            path = job.evidence[number]
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                with whole_file(path) as file:
                    file.write(content)
            except OSError as error:
                notes.append(escaped_line(f"{job.named(path)}: {system_reason(error)}"))
        endings = {Path(name).suffix for name in outcome.recordings}
        return outcome.model_copy(
            update={
                "trace": job.trace_name if outcome.trace else None,
                "replay": job.named(job.replay) if job.replay and outcome.replay else None,
                "recordings": tuple(job.named(path) for path in job.recordings if path.suffix in endings),
                "notes": tuple(notes),
            }
        )

    def _error(self, index: int, cause: str) -> Outcome:
        failure = Failure(kind="crash", title="cluster", message=escaped_line(cause))
        return without_verdict(self._runs.loaded(index), failure)

    @override
    def _finish(self, index: int, outcome: Outcome, key: str | None = None) -> None:
        self._start(index)
        super()._finish(index, outcome, key)

    @override
    def _start_no_more(self) -> None:
        self._batches.clear()
        self._cancel([task for task in self._tasks.values() if self._started.isdisjoint(task.indices)])

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
        left = [index for task in self._tasks.values() for index in task.indices]
        self._tasks.clear()
        for index in (*left, *self._batches.clear()):
            self._finish(index, self._error(index, cause))


def _killed(workers: Sequence[str]) -> str:
    """Return the cause of an error; `workers`: the addresses of the workers that died while they ran a scenario."""
    *_, last = workers
    return (
        f"{counted(len(workers), 'worker')} died while running this scenario, the last one at {last}; it may need more "
        "memory than they have, and the log of the worker may say more"
    )


_CONNECT_TIMEOUT_S: Final = 5.0
# A worker that dies for the third time while it runs a scenario.
_LOCAL_SETTINGS: Final = {
    "distributed.scheduler.allowed-failures": 2,
    # So long after the death of a worker, LocalCluster ends for good what restarts workers if no worker happens to be
    # there at that moment (15 s by default): the next one may be starting on a busy machine.
    "distributed.deploy.lost-worker-timeout": "7d",
    "distributed.scheduler.worker-saturation": 1.0,
    "distributed.worker.profile.enabled": False,
    # Nothing uses these measurements, which Dask would take many times a second.
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
    "distributed.admin.system-monitor.gil.enabled": False,
    "distributed.worker.memory.monitor-interval": "5s",
}


@contextmanager
def opened_cluster(
    address: ClusterAddress, scenarios: Sequence[LoadedScenario], permissions: Permissions, outputs: Collection[Path]
) -> Iterator[DaskExecutor]:
    """Connect to a cluster, compare its software, and send it the workspaces of the scenarios.

    `outputs`: the output folder and the files of reports, which are not sent.

    Raises UsageError.
    """
    # They are for who runs the cluster, such as that a disk is slow.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    warnings.filterwarnings("ignore", module=r"distributed\.")
    needed = software(tuple(sorted({chosen(loaded.scenario.backend) for loaded in scenarios})))
    archives = _archives(scenarios, permissions, [path.absolute() for path in outputs])
    with ExitStack() as stack:
        client = _client(address, stack)
        executor = DaskExecutor(client, address, archives, needed, permissions)
        executor.prepare()
        yield executor


def _client(address: ClusterAddress, stack: ExitStack) -> Client:
    """Return a connection; `stack` closes it, and ends workers on this machine. Raise UsageError."""
    if address.workers is None:
        try:
            client = Client(address.text, timeout=_CONNECT_TIMEOUT_S, set_as_default=False)
        except TypeError:
            # Dask has no SSL context.
            raise UsageError(
                f"--cluster: {address.text} needs the certificates of the cluster in the settings of Dask, such as "
                "distributed.comm.tls.ca-file; see https://distributed.dask.org/en/stable/tls.html"
            ) from None
        except (OSError, ValueError, RuntimeError) as error:
            raise UsageError(
                f"--cluster: no Dask scheduler answers at {address.text} within {_CONNECT_TIMEOUT_S:g} s "
                f"({_refusal(error)}); start one with dask scheduler, and look whether this machine may connect to it"
            ) from None
        stack.callback(_close, client)
        return client
    folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="sim-action-", ignore_cleanup_errors=True))
    stack.enter_context(dask.config.set(_LOCAL_SETTINGS))
    try:
        cluster = LocalCluster(
            n_workers=address.workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address=None,
            memory_limit=0,
            local_directory=folder,
            silence_logs=logging.CRITICAL,
        )
        stack.callback(_close, cluster)
        client = Client(cluster, set_as_default=False)
    except (OSError, RuntimeError) as error:
        raise UsageError(f"--cluster: the workers of {address.text} did not start ({_refusal(error)})") from None
    stack.callback(_close, client)
    return client


def _close(opened: Client | LocalCluster) -> None:
    """Close it. What Dask cannot end in time, on a busy machine, ends with this process: no outcome is lost for it."""
    with suppress(Exception):
        opened.close()


def _refusal(error: Exception) -> str:
    return escaped_line(str(error.__cause__ or error).rpartition("Error: ")[2])


def _archives(
    scenarios: Sequence[LoadedScenario], permissions: Permissions, outputs: Collection[Path]
) -> Mapping[Path, Archive]:
    """Return the archives of the workspaces, and of packages outside of them, by their folders. Raise UsageError."""
    current_folder = Path.cwd()
    finder = NamedFiles()
    named: dict[Path, set[Path]] = {}
    for loaded in scenarios:
        named.setdefault(loaded.workspace.root, set()).update(finder.of(loaded.source))
    for _, folder in permissions.packages:
        if not any(Path(folder).is_relative_to(root) for root in named):
            named[Path(folder)] = set()
    return {root: archive_of(root, current_folder, files, outputs) for root, files in named.items()}


class DaskExecutor:
    """A cluster that is ready to run the scenarios that it was opened for."""

    def __init__(
        self,
        client: Client,
        address: ClusterAddress,
        archives: Mapping[Path, Archive],
        needed: Software,
        permissions: Permissions,
    ) -> None:
        self._client, self._address, self._archives = client, address, archives
        self._needed, self._permissions = needed, permissions

    def prepare(self) -> None:
        """Refuse a cluster without workers or with other software, and send all workspaces. Raise UsageError."""
        text = self._address.text
        if not self._client.nthreads():
            raise UsageError(f"--cluster: {text} has no workers; start one on each machine with dask worker {text}")
        engines = tuple(dict(self._needed.engines))
        software_by_worker = self._client.run(software, engines, on_error="return")
        refused = [f"the worker {worker} {reason}" for worker, reason in _refusals(software_by_worker, self._needed)]
        if refused:
            raise UsageError("\n".join(escaped_line(f"--cluster: {line}") for line in refused))
        roundings = Counter("; ".join(installed.roundings(self._needed)) for installed in software_by_worker.values())
        for difference, workers in roundings.items():
            if difference:
                note(f"--cluster: {counted(workers, 'worker')}: {difference}; {_OTHER_ROUNDING}")
        for archive in self._archives.values():
            self._send(archive)

    def _send(self, archive: Archive, worker: str | None = None) -> None:
        """Send a workspace to one worker, or to all. Raise UsageError."""
        workers = None if worker is None else [worker]
        for address, error in self._client.run(receive, archive, workers=workers, on_error="return").items():
            if isinstance(error, BaseException):
                raise UsageError(escaped_line(f"--cluster: the worker {address} cannot take the workspace: {error}"))

    def scheduler(self, runs: Runs, emit: Listener, interruption: Interruption) -> ClusterRuns:
        """Return what runs these runs on the workers. No run has a key: it depends on another machine."""
        output = Output(runs.replays, tuple(runs.formats), runs.repeat)
        current_folder = Path.cwd()

        def task(indices: Sequence[int]) -> Task:
            several = [runs.loaded(index) for index in indices]
            own = self._archives[several[0].workspace.root].copied
            others = (archive.copied for archive in self._archives.values() if archive.copied is not own)
            return Task(
                tuple(map(Run.of, indices, several)),
                indices[0] // len(runs.scenarios) + 1,
                self._permissions,
                current_folder,
                copied=(own, *others),
                output=output,
                software=self._needed,
            )

        shares = runs.repeat == 1 and not runs.fail_fast
        kinds = [_kind(loaded) if shares else None for loaded in runs.scenarios] * runs.repeat
        batches = Batches(runs.waiting, kinds)
        return ClusterRuns(runs, emit, interruption, self._client, task=task, send=self._send_missing, batches=batches)

    def _send_missing(self, reply: Reply) -> None:
        for archive in self._archives.values():
            if archive.copied.digest in reply.lacks:
                self._send(archive, reply.worker)


def _kind(loaded: LoadedScenario) -> Path | None:
    return None if loaded.scenario.runs_user_code else loaded.workspace.root


_OTHER_ROUNDING: Final = (
    "numbers may differ in their last digits, and with them digests, golden trajectories and verdicts at a limit; "
    "results.json names the machine of each run (provenance)"
)


def _refusals(
    software_by_worker: Mapping[str, Software | BaseException], needed: Software
) -> Iterator[tuple[str, str]]:
    for worker, answer in software_by_worker.items():
        if isinstance(answer, BaseException):
            yield worker, f"cannot run scenarios: {answer}; install this version of sim-action there"
        elif differences := "; ".join(answer.differences(needed)):
            yield worker, f"has other software: {differences}; install the same there"
