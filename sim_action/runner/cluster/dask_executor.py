"""The executor on a cluster of Dask: it takes the place of `process_pool.Pool`."""

from __future__ import annotations

import logging
import tempfile
import warnings
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final

import dask.config
from distributed import Client, LocalCluster

from sim_action.core.errors import UsageError
from sim_action.core.permissions import Permissions
from sim_action.core.process import Interruption
from sim_action.core.wording import escaped_line
from sim_action.engines import chosen
from sim_action.results.events import Listener
from sim_action.runner.cluster.address import ClusterAddress
from sim_action.runner.cluster.batches import Batches
from sim_action.runner.cluster.dask_runs import ClusterRuns
from sim_action.runner.cluster.dask_worker import Reply, receive, software_there
from sim_action.runner.cluster.software import Software, software
from sim_action.runner.cluster.task import Output, Run, Task
from sim_action.runner.cluster.workspace_archive import Archive, archive_of
from sim_action.runner.runs import Runs
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.watched_files import NamedFiles

_CONNECT_TIMEOUT_S: Final = 5.0
# A worker that dies for the third time while it runs a scenario.
_LOCAL_SETTINGS: Final = {
    "distributed.scheduler.allowed-failures": 2,
    "distributed.scheduler.worker-saturation": 1.0,
    "distributed.worker.profile.enabled": False,
    # Nobody looks at what Dask would measure many times a second.
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
        stack.enter_context(client)
        return client
    folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="sim-action-", ignore_cleanup_errors=True))
    stack.enter_context(dask.config.set(_LOCAL_SETTINGS))
    cluster = stack.enter_context(
        LocalCluster(
            n_workers=address.workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address=None,
            memory_limit=0,
            local_directory=folder,
            silence_logs=logging.CRITICAL,
        )
    )
    client = Client(cluster, set_as_default=False)
    stack.enter_context(client)
    return client


def _refusal(error: Exception) -> str:
    return escaped_line(str(error.__cause__ or error).rpartition("Error: ")[2])


def _archives(
    scenarios: Sequence[LoadedScenario], permissions: Permissions, outputs: Collection[Path]
) -> Mapping[Path, Archive]:
    """Return the archives of the workspaces, and of packages outside of them, by their folders. Raise UsageError."""
    here, finder = Path.cwd(), NamedFiles()
    named: dict[Path, set[Path]] = {}
    for loaded in scenarios:
        named.setdefault(loaded.workspace.root, set()).update(finder.of(loaded.source))
    for _, folder in permissions.packages:
        if not any(Path(folder).is_relative_to(root) for root in named):
            named[Path(folder)] = set()
    return {root: archive_of(root, here, files, outputs) for root, files in named.items()}


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
        found = self._client.run(software_there, engines, on_error="return")
        refused = [f"the worker {worker} {reason}" for worker, reason in _refusals(found, self._needed)]
        if refused:
            raise UsageError("\n".join(escaped_line(f"--cluster: {line}") for line in refused))
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
        output, here = Output(runs.replays, tuple(runs.formats), runs.repeat), Path.cwd()

        def task(indices: Sequence[int]) -> Task:
            several = [runs.loaded(index) for index in indices]
            own = self._archives[several[0].workspace.root].copied
            others = (each.copied for each in self._archives.values() if each.copied is not own)
            return Task(
                tuple(map(Run.of, indices, several)),
                runs.place_and_turn(indices[0])[1],
                self._permissions,
                here,
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


def _refusals(found: Mapping[str, Software | BaseException], needed: Software) -> Iterator[tuple[str, str]]:
    for worker, there in found.items():
        if isinstance(there, BaseException):
            yield worker, f"cannot run scenarios: {there}; install this version of sim-action there"
        elif differences := "; ".join(there.differences(needed)):
            yield worker, f"has other software: {differences}; install the same there"
