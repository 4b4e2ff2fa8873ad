"""Runs on a cluster of Dask on this machine: the same results as without it, whatever happens to its workers."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import pytest
from distributed import Client

import sim_action
from sim_action.ros.processes import command_line
from sim_action.runner.isolation.process_control import processes
from tests.integration.conftest import ACTION, BOX, write
from tests.patience import PATIENCE, wait_until
from tests.scenarios import driving
from tests.soak import soaked

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="it looks for processes in /proc")
ENVIRONMENT: Final = {**os.environ, "PYTHONPATH": str(ACTION), "GITHUB_ACTIONS": ""}

SCRIPTED: Final = """\
name: raises
robot: {model: box.urdf}
commands: {script: controllers/raises.py}
expect: [{settled: {}}]
duration: 0.5 s
time_limit: 1 s
"""
RAISES: Final = "def control(observation):\n    raise ValueError(__file__)\n"


def drives(samples: int) -> str:
    travels = driving("burger drives on what it finds", "{twist: [{linear: 1.0}]}", at_least="1.5 m", time_limit="4 s")
    friction = f"{{uniform: [0.4, 1.2], samples: {samples}}}"
    return f"{travels}duration: 4 s\nvariations: {{world.ground.friction: {friction}}}\n"


def arguments(*options: str) -> list[str]:
    return [sys.executable, "-m", "sim_action", "run", *options]


def run(folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        arguments(*options), cwd=folder, env=ENVIRONMENT, capture_output=True, text=True, timeout=PATIENCE, check=False
    )


def timeless(value: Any) -> Any:
    """Results without times, and without what depends on the machine."""
    if isinstance(value, dict):
        left_out = {"started_at", "wall_time", "real_time_factor", "provenance"}
        return {key: timeless(inner) for key, inner in value.items() if key not in left_out}
    return [timeless(inner) for inner in value] if isinstance(value, list) else value


def results(folder: Path) -> dict[str, Any]:
    """The results in a folder, as `timeless` has them."""
    return dict(timeless(json.loads((folder / "results.json").read_text())))


def files(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


@contextmanager
def started(folder: Path, *options: str) -> Iterator[subprocess.Popen[str]]:
    """A call on two workers of this machine, whose standard error can be read."""
    command = arguments("--cluster", "local:2", "--output-dir", "there", *options)
    process = subprocess.Popen(
        command, cwd=folder, env=ENVIRONMENT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    watchdog = threading.Timer(PATIENCE, process.kill)
    watchdog.start()
    try:
        yield process
    finally:
        watchdog.cancel()
        process.kill()
        process.wait()
        assert process.stderr is not None
        process.stderr.close()


def wait_for(process: subprocess.Popen[str], count: int) -> None:
    """Wait for outcomes; the workers of Dask may warn on standard error that the machine is slow."""
    assert process.stderr is not None
    while count:
        line = process.stderr.readline()
        assert line
        count -= "] passed" in line


def children_of(parent: int) -> list[int]:
    return [process.number for process in processes() if process.parent == parent]


def workers_of(process: subprocess.Popen[str]) -> list[int]:
    def workers() -> list[int]:
        return [pid for pid in children_of(process.pid) if b"spawn_main" in command_line(pid)]

    wait_until(lambda: len(workers()) == 2)
    return workers()


def end_with(process: subprocess.Popen[str], number: signal.Signals) -> None:
    """Send a signal after two outcomes, and wait for the ends of the call, its workers and their children."""
    wait_for(process, 2)
    pids = workers_of(process)
    pids += [child for pid in pids for child in children_of(pid)]
    process.send_signal(number)
    process.communicate()
    wait_until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in pids))


@pytest.mark.parametrize("samples", soaked((8, 200), (8,)))
def test_results_are_those_of_a_run_without_a_cluster_also_if_a_worker_is_killed(tmp_path: Path, samples: int) -> None:
    (tmp_path / "drives.sim.yml").write_text(drives(samples))
    write(tmp_path / "controllers/raises.py", RAISES)
    write(tmp_path / "box.urdf", BOX)
    write(tmp_path / "raises.sim.yml", SCRIPTED)
    here = run(tmp_path, "-j", "2", "--output-dir", "here", "--record", "csv")
    with started(tmp_path, "--record", "csv") as process:
        wait_for(process, 3)
        os.kill(workers_of(process)[0], signal.SIGKILL)
        _, told = process.communicate()
    assert here.returncode == process.returncode == 1, told
    assert results(tmp_path / "here") == results(tmp_path / "there")
    assert files(tmp_path / "here") == files(tmp_path / "there")
    outcomes = results(tmp_path / "there")["outcomes"]
    assert len({outcome["name"] for outcome in outcomes}) == len(outcomes) == samples + 1
    assert told.count("] passed") == samples - 3
    (raised,) = (outcome for outcome in outcomes if outcome["name"] == "raises")
    assert "controllers/raises.py" in str(raised["failures"])


@pytest.mark.soak
def test_a_signal_ends_all_workers_and_keeps_what_has_ended(tmp_path: Path) -> None:
    (tmp_path / "drives.sim.yml").write_text(drives(100))
    with started(tmp_path) as process:
        end_with(process, signal.SIGINT)
    assert process.returncode == 130
    outcomes = results(tmp_path / "there")["outcomes"]
    assert len(outcomes) == 100
    assert {outcome["status"] for outcome in outcomes} == {"passed", "error"}
    kinds = {failure["kind"] for outcome in outcomes for failure in outcome["failures"]}
    assert kinds == {"interrupted"}


@pytest.mark.soak
def test_a_caller_that_is_killed_leaves_no_worker_behind(tmp_path: Path) -> None:
    (tmp_path / "drives.sim.yml").write_text(drives(100))
    with started(tmp_path) as process:
        end_with(process, signal.SIGKILL)


@contextmanager
def dask(*options: str) -> Iterator[None]:
    silent = subprocess.DEVNULL
    command = [sys.executable, "-m", "dask", *options]
    process = subprocess.Popen(command, cwd=ACTION, env=ENVIRONMENT, stdout=silent, stderr=silent)
    try:
        yield
    finally:
        process.terminate()
        process.wait(PATIENCE)


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[str]:
    """The address of a scheduler."""
    file = tmp_path / "scheduler.json"
    with dask("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)):
        # The scheduler does not write it in one go.
        wait_until(lambda: file.exists() and file.read_text().endswith("}"))
        yield json.loads(file.read_text())["address"]


@contextmanager
def worker(scheduler: str, folder: Path) -> Iterator[None]:
    folder.mkdir()
    options = ("--host", "127.0.0.1", "--nthreads", "1", "--no-dashboard", "--local-directory", str(folder))
    with dask("worker", scheduler, *options):
        with Client(scheduler) as client:
            client.wait_for_workers(1, PATIENCE)
        yield


@pytest.mark.soak
def test_a_cluster_that_is_there_runs_scenarios_and_keeps_their_workspace(tmp_path: Path, scheduler: str) -> None:
    project = write(tmp_path / "project/drives.sim.yml", drives(2)).parent
    options = ("--cluster", scheduler, "--no-report", "--output-dir", "there")
    refused = run(project, *options)
    assert refused.returncode == 2
    assert f"{scheduler} has no workers; start one on each machine with dask worker {scheduler}" in refused.stderr
    with worker(scheduler, tmp_path / "scratch"):
        for _ in range(2):
            ran = run(project, *options)
            assert ran.returncode == 0, ran.stderr
        assert len(list((tmp_path / "scratch").rglob("drives.sim.yml"))) == 1


@pytest.mark.parametrize(
    ("address", "cause"),
    [
        ("tcp://127.0.0.1:9", "no Dask scheduler answers at tcp://127.0.0.1:9 within 5 s"),
        ("tls://127.0.0.1:9", "tls://127.0.0.1:9 needs the certificates of the cluster in the settings of Dask"),
    ],
)
def test_a_scheduler_that_cannot_be_reached_is_refused(address: str, cause: str, tmp_path: Path) -> None:
    # A client that cannot connect leaves a thread in its process.
    refused = run(write(tmp_path / "drives.sim.yml", drives(2)).parent, "--cluster", address)
    assert refused.returncode == 2
    assert cause in refused.stderr
    assert "Traceback" not in refused.stderr


def test_programs_use_a_cluster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "drives.sim.yml").write_text(drives(2))
    gate = "gate: {passes: {at_least: 50 %, confidence: 75 %}}\n"
    (tmp_path / "gate.sim.yml").write_text(drives(2) + gate)
    ran = sim_action.run(["drives.sim.yml", "gate.sim.yml"], cluster="local:1", output_dir="there")
    assert ran.passed
    assert [outcome.status for outcome in ran.outcomes] == ["passed", "passed", "passed"]
    assert [len(gate.runs) for gate in ran.gates] == [2]
