"""Everything that runs on macOS and Windows is imported, and runs scenarios, where Python has what it has there."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Final

import pytest

import sim_action.robot
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from tests.integration.conftest import fresh_sim_action, interpreter
from tests.integration.conftest import sim_action as warm_sim_action
from tests.integration.marked_processes import processes_of, wait_for
from tests.integration.other_systems import System, variables_of
from tests.patience import PATIENCE, wait_until
from tests.soak import soaked

SCENARIO: Final = """\
name: {name}
robot: {{model: turtlebot3_burger}}
commands: {commands}
expect: [{{travel: {{at_least: 0.1 m}}}}]
time_limit: 5 s
wall_limit: {wall_limit} s
"""
DRIVE: Final = "return Twist.planar(0.5)"
# Name -> what the script does, and how that ends; the title of the failure, if any.
SCRIPTS: Final = {
    "controlled": (f"print('✓ started')\n{DRIVE}", ""),
    "raises": ("return 1 / 0", "script error"),
    "aborts": ("print('last words', flush=True)\nos.abort()", "SIGABRT"),
    "leaves": ("os._exit(7)", "exit 7"),
    "closes": (f"os.closerange(1, 64)\n{DRIVE}", "script error"),
    "loops": ("time.sleep(600)", "wall limit"),
    "floods": ("while True: print('x' * 1000)", "output limit"),
    "threads": (f"threading.Thread(target=time.sleep, args=(600,)).start()\n{DRIVE}", ""),
}
# By what they are made of, they are Linux's alone.
ELSEWHERE: Final = (
    "sim_action.runner.warm_process",
    # Packages of Dask for that system are not installed here.
    *(f"sim_action.runner.cluster.dask_{name}" for name in ("executor", "worker")),
    *(
        f"sim_action.runner.isolation.{name}"
        for name in (
            "command_supervisor",
            "linux_child",
            "preloaded_interpreter",
            "process_control",
            "scenario_supervisor",
        )
    ),
)
ROS: Final = "sim_action.ros."  # the command that needs it is refused there, and before any of it is imported

# Prints the names of modules that can be imported, and "-" before those that cannot.
IMPORT_ALL: Final = """
import importlib, pkgutil, sys, sim_action
for module in pkgutil.walk_packages(sim_action.__path__, "sim_action."):
    if module.name.endswith("__main__") or "pybullet" in module.name or module.name.startswith(sys.argv[1]):
        continue
    try:
        importlib.import_module(module.name)
        print(module.name)
    except Exception as error:
        print("-" + module.name, repr(error).replace(" ", "_"))
"""

every_system = pytest.mark.parametrize("system", ["darwin", "win32"])


def write_script(folder: Path, name: str, body: str, wall_limit: float = 60, more: str = "") -> None:
    lines = "\n".join(f"    {line}" for line in body.splitlines())
    head = "import os, subprocess, sys, threading, time\nfrom sim_action import Twist\n"
    (folder / f"{name}.py").write_text(f"{head}def control(observation):\n{lines}\n", encoding="utf-8")
    text = SCENARIO.format(name=name, commands=f"{{script: {name}.py}}", wall_limit=wall_limit)
    (folder / f"{name}.sim.yml").write_text(text + more)


def start(folder: Path, variables: Mapping[str, str], *options: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "sim_action", "run", ".", *options],
        cwd=folder,
        env={**variables, "ROS_MARK": str(folder)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


@every_system
def test_every_module_but_those_of_linux_is_imported(tmp_path: Path, system: System) -> None:
    ran = interpreter(tmp_path, "-c", IMPORT_ALL, ROS, env=variables_of(system, tmp_path))
    assert ran.returncode == 0, ran.stderr
    lines = ran.stdout.splitlines()
    imported = {line for line in lines if not line.startswith("-")}
    others = {line[1:].split()[0] for line in lines if line.startswith("-")}
    portable = {"runner.isolation.portable_child", "engines.mujoco.engine", "app.run"}
    assert {f"sim_action.{name}" for name in portable} <= imported
    assert len(imported) > 150
    # On Windows, Python has nothing of what they need.
    assert others == set(ELSEWHERE) if system == "win32" else others <= set(ELSEWHERE), ran.stdout


# Programs run as on the other one in test_processes.py.
@pytest.mark.parametrize("system", soaked(["darwin", "win32"], short=["win32"]))
def test_scenarios_have_the_same_verdicts_and_ends_as_on_linux(tmp_path: Path, system: System) -> None:
    (tmp_path / "plain.sim.yml").write_text(
        SCENARIO.format(name="plain", commands="{twist: [{linear: 0.5}]}", wall_limit=60)
    )
    for name, (body, _) in SCRIPTS.items():
        more = "output_limit: 1 MB\n" if name == "floods" else ""
        write_script(tmp_path, name, body, wall_limit=3 if name == "loops" else 60, more=more)
    run = start(tmp_path, variables_of(system, tmp_path), "--backend", "mujoco")
    log, _ = run.communicate(timeout=PATIENCE)
    assert run.returncode == 1, log
    assert processes_of(tmp_path) == []
    outcomes = {o.name: o for o in Results.read(tmp_path / "sim-results/results.json").outcomes}
    assert {name: title_of(outcomes[name]) for name in SCRIPTS} == {name: title for name, (_, title) in SCRIPTS.items()}
    assert outcomes["plain"].status == outcomes["controlled"].status == "passed"
    assert outcomes["plain"].digest == outcomes["controlled"].digest == digest_here(tmp_path)
    assert outcomes["controlled"].output.startswith("✓ started")
    assert "last words" in outcomes["aborts"].output


def title_of(outcome: Outcome) -> str:
    return outcome.failures[0].title if outcome.failures else ""


def digest_here(folder: Path) -> str | None:
    warm_sim_action(folder, "run", "plain.sim.yml", "--backend", "mujoco", "--output-dir", "here")
    (outcome,) = Results.read(folder / "here/results.json").outcomes
    return outcome.digest


@pytest.mark.parametrize(
    ("system", "number"),
    soaked(
        product(["darwin", "win32"], [signal.SIGINT, signal.SIGTERM]),
        short=[("darwin", signal.SIGTERM), ("win32", signal.SIGINT)],
    ),
)
def test_an_interrupted_run_leaves_no_process(tmp_path: Path, system: System, number: signal.Signals) -> None:
    write_script(tmp_path, "loops", "time.sleep(600)")
    run = start(tmp_path, variables_of(system, tmp_path), "--backend", "mujoco")
    wait_for(2, tmp_path)
    run.send_signal(number)
    run.communicate(timeout=PATIENCE)
    assert run.returncode == 130
    assert processes_of(tmp_path) == []
    (outcome,) = Results.read(tmp_path / "sim-results/results.json").outcomes
    assert title_of(outcome) == "interrupted"


@pytest.mark.parametrize("system", soaked(["darwin", "win32"], short=["win32"]))
def test_a_call_that_is_killed_outright_takes_its_children_with_it(tmp_path: Path, system: System) -> None:
    write_script(tmp_path, "waits", "open('began', 'w').close()\ntime.sleep(600)")
    run = start(tmp_path, variables_of(system, tmp_path), "--backend", "mujoco")
    wait_until((tmp_path / "began").exists)
    wait_for(2, tmp_path)
    run.kill()
    run.communicate(timeout=PATIENCE)
    wait_for(0, tmp_path)


def test_where_there_are_process_groups_what_stays_in_that_of_the_child_is_ended(tmp_path: Path) -> None:
    write_script(tmp_path, "untidy", f"if observation.time == 0: subprocess.Popen(['sleep', '600'])\n{DRIVE}")
    run = start(tmp_path, variables_of("darwin", tmp_path), "--backend", "mujoco")
    log, _ = run.communicate(timeout=PATIENCE)
    assert run.returncode == 0, log
    wait_for(0, tmp_path)


def test_newlines_of_a_windows_checkout_change_nothing(tmp_path: Path) -> None:
    robot = Path(sim_action.robot.__file__).parent / "built_in/turtlebot3_burger.urdf"
    for folder, newline in (("linux", "\n"), ("windows", "\r\n")):
        (tmp_path / folder).mkdir()
        write_script(tmp_path / folder, "drives", DRIVE)
        (tmp_path / folder / "robot.urdf").write_bytes(robot.read_bytes())
        for path in (tmp_path / folder).iterdir():
            text = path.read_text().replace("model: turtlebot3_burger", "model: robot.urdf")
            path.write_text(text, newline=newline)
    assert b"\r\n" in (tmp_path / "windows/robot.urdf").read_bytes()
    assert warm_sim_action(tmp_path, "run", "linux", "windows").returncode == 0
    one, other = Results.read(tmp_path / "sim-results/results.json").outcomes
    assert one.digest == other.digest


@pytest.mark.parametrize("encoding", soaked(["cp1252", "cp437", "ascii"], short=["cp1252"]))
def test_a_console_without_our_symbols_is_told_all_the_same(tmp_path: Path, encoding: str) -> None:
    write_script(tmp_path, "raises", "return 1 / 0  # ✓")
    ran = fresh_sim_action(tmp_path, "run", ".", PYTHONIOENCODING=encoding)
    assert ran.returncode == 1
    assert "Traceback" not in ran.stdout + ran.stderr
    assert "ZeroDivisionError" in ran.stdout
