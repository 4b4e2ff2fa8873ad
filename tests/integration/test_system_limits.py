"""Runs within the limits of the system: all verdicts are kept, whatever it refuses."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Final

import pytest

from sim_action.core.process import Interruption
from sim_action.results.results_json import Results
from sim_action.runner.isolation.child_process import ChildProcess
from sim_action.runner.isolation.linux_child import LinuxChild
from sim_action.runner.isolation.portable_child import PortableChild
from sim_action.scenario.loading import load_scenario
from tests.integration.test_execution import scenario, script, silent
from tests.pool import execute
from tests.soak import soaked

ROOT: Final = Path(__file__).parents[2]

# More descriptors than `select` can wait for, and then the run.
MANY: Final = """
import os, sys
for _ in range(1100):
    os.set_inheritable(os.open(os.devnull, os.O_RDONLY), True)
os.execv(sys.executable, [sys.executable, *sys.argv[1:]])
"""

# The first supervisor cannot fork.
REFUSING: Final = """
import errno, os, sys
from pathlib import Path

marker, real = Path(__file__).with_name("refused"), os.fork


def fork():
    if marker.exists():
        return real()
    marker.touch()
    raise OSError(errno.EAGAIN, os.strerror(errno.EAGAIN))


if any("sim_action.runner.isolation" in word for word in sys.orig_argv):
    os.fork = fork
"""


def statuses(folder: Path, before: str, jobs: int, *words: str) -> dict[str, str]:
    """Return name -> status of a run; `before`: what the shell does before it."""
    environment = {**os.environ, "PYTHONPATH": f"{folder}:{ROOT}", "GITHUB_ACTIONS": ""}
    command = ["bash", "-c", f'{before}; exec "$@"', "bash", sys.executable, *words]
    run = [*command, "-m", "sim_action", "run", ".", "--jobs", str(jobs)]
    ran = subprocess.run(run, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "Traceback" not in ran.stdout + ran.stderr
    return {outcome.name: outcome.status for outcome in Results.read(folder / "sim-results" / "results.json").outcomes}


@pytest.fixture
def mixed(tmp_path: Path) -> Path:
    for name in ("a", "b"):
        scenario(tmp_path, name)
        script(tmp_path, f"{name}-script", "return Twist.planar(0.5)")
    return tmp_path


@pytest.mark.parametrize("most", soaked([20, 24, 32, 64, 256], short=[24]))
def test_few_descriptors_cost_no_verdict(mixed: Path, most: int) -> None:
    assert sorted(statuses(mixed, f"ulimit -n {most}", 40).values()) == ["passed"] * 4


@pytest.mark.soak
def test_many_descriptors_cost_no_verdict(mixed: Path) -> None:
    (mixed / "many.py").write_text(MANY)
    assert sorted(statuses(mixed, "ulimit -n 2000", 256, "many.py").values()) == ["passed"] * 4


def test_a_supervisor_that_cannot_fork_costs_no_verdict(mixed: Path) -> None:
    (mixed / "sitecustomize.py").write_text(REFUSING)
    assert sorted(statuses(mixed, "true", 3).values()) == ["passed"] * 4
    assert (mixed / "refused").exists()


@pytest.mark.parametrize("way", soaked([LinuxChild, PortableChild], short=[LinuxChild]))
def test_a_child_takes_no_more_descriptors_than_it_says(tmp_path: Path, way: type[ChildProcess]) -> None:
    paths = [scenario(tmp_path, name) for name in "ab"]
    paths += [script(tmp_path, f"{name}-script", "return Twist.planar(0.5)") for name in "ab"]
    counts: list[int] = []

    def count() -> None:
        counts.append(len(list(Path("/proc/self/fd").iterdir())))

    scenarios = [load_scenario(path) for path in paths]
    with Interruption() as interruption:
        # The engine is loaded, and keeps what it keeps.
        execute(scenarios, tmp_path, 4, silent, interruption, child_type=way)
        count()
        execute(scenarios, tmp_path, 4, silent, interruption, child_type=way, meanwhile=count)
        count()
    before, while_they_run, after = counts
    preloaded = 1  # the channel to the interpreter that is forked for user code
    assert before < while_they_run <= before + preloaded + 4 * way.descriptors
    assert after == before
