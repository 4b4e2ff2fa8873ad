"""A suite with ten scenarios that kill, hang, hog, flood and hide: real processes, two at a time.

Everyone else gets a verdict, each of the ten an error with its cause, and no process is left.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Final

import junitparser

from sim_action.engines import installed
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from tests.integration.marked_processes import processes_of, wait_for
from tests.patience import PATIENCE

ROOT: Final = Path(__file__).parents[2]

HONEST: Final = """\
name: honest {number}
robot: {{model: turtlebot3_burger}}
physics: {{settle: 0}}
expect: [upright]
time_limit: 0.1 s
"""

KILLER: Final = """\
name: {name}
robot: {{model: turtlebot3_burger}}
physics: {{settle: 0}}
commands: {{script: {script}}}
expect: [upright]
time_limit: 0.1 s
{limits}
"""

LEAVES_A_SESSION: Final = """\
if os.fork() == 0:
    os.setsid()
    for _ in range(3):
        os.fork()
    time.sleep(600)
time.sleep(0.3)
os.abort()
"""

# Name -> what the script does when it is asked, the limits of the scenario, the kind of the error, and its cause.
KILLERS: Final = {
    "segfault": ("os.kill(os.getpid(), signal.SIGSEGV)", "", "crash", "ended by SIGSEGV: native code crashed"),
    "abort": ("print('last words', flush=True); os.abort()", "", "crash", "ended by SIGABRT"),
    "endless loop": ("while True: pass", "wall_limit: 1 s", "wall limit", "no verdict after 1 s of wall time"),
    "memory hog": (
        "hog = [bytearray(1 << 26) for _ in range(1000)]",
        "memory_limit: 1 GiB",
        "memory",
        "more than the 1 GiB of memory that it is allowed (memory_limit)",
    ),
    "exit": ("os._exit(0)", "", "crash", "exit.py:4 called os._exit(0): the process of this"),
    "forks and leaves": (
        "if os.fork() == 0: time.sleep(600)\nos._exit(7)",
        "",
        "crash",
        "its last report was at 0.00 s of sim time; ended a process that its script left behind",
    ),
    "leaves a session": (LEAVES_A_SESSION, "", "crash", "ended 8 processes that its script left behind"),
    "endless output": (
        "while True: print('flood ' * 100)",
        "output_limit: 1 MB",
        "crash",
        "more than 1 MB were printed (output_limit)",
    ),
    "system exit": ("raise SystemExit", "", "script", "the controller raised SystemExit"),
    "closes descriptors": (
        "os.closerange(0, 4096)",
        "",
        "script",
        "the controller closed file descriptors of sim-action: 1 (standard output), 2 (standard error)",
    ),
}


def script(folder: Path, name: str, body: str, limits: str = "") -> Path:
    lines = "\n".join(f"    {line}" for line in body.splitlines())
    stem = name.replace(" ", "_")
    (folder / f"{stem}.py").write_text(
        f"import os, signal, subprocess, sys, time\n\ndef control(observation):\n{lines}\n"
    )
    path = folder / f"{stem}.sim.yml"
    path.write_text(KILLER.format(name=name, script=f"{stem}.py", limits=limits))
    return path


def write_suite(folder: Path, total: int) -> None:
    """Killers among the others, so that each runs beside one that is honest."""
    for number in range(total - len(KILLERS)):
        (folder / f"{number:03}.sim.yml").write_text(HONEST.format(number=number))
    for index, (name, (body, limits, _, _)) in enumerate(KILLERS.items()):
        path = script(folder, name, body, limits)
        path.rename(folder / f"{index * (total - len(KILLERS)) // len(KILLERS):03}-{path.name}")


def start(folder: Path, *options: str) -> subprocess.Popen[str]:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("GITHUB_")}
    return subprocess.Popen(
        [sys.executable, "-m", "sim_action", "run", ".", "--jobs", "2", *options],
        cwd=folder,
        env={**environment, "PYTHONPATH": str(ROOT), "ROS_MARK": str(folder)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def outcomes(folder: Path) -> dict[str, Outcome]:
    run = start(folder)
    run.communicate(timeout=PATIENCE)
    results = Results.read(folder / "sim-results/results.json")
    return {outcome.name: outcome for outcome in results.outcomes}


def test_ten_killers_cost_ten_scenarios_and_nothing_else(tmp_path: Path) -> None:
    total = 2 * len(KILLERS)
    write_suite(tmp_path, total)
    run = start(tmp_path)
    run.communicate(timeout=PATIENCE)
    assert run.returncode == 1
    # Asked at once: the call itself must have waited for all of them.
    assert processes_of(tmp_path) == []

    results = Results.read(tmp_path / "sim-results/results.json")
    assert (results.total, results.count("passed"), results.count("error")) == (total, total - len(KILLERS), 10)
    found = {outcome.name: outcome.failures for outcome in results.outcomes if outcome.failures}
    assert found.keys() == KILLERS.keys()
    for name, (_, _, kind, cause) in KILLERS.items():
        (failure,) = found[name]
        assert (name, failure.kind) == (name, kind)
        assert cause in failure.message

    junit = junitparser.JUnitXml.fromfile(str(tmp_path / "sim-results/junit.xml"))
    assert (junit.tests, junit.errors, junit.failures) == (total, len(KILLERS), 0)
    assert len(list(junit)) == total


HYDRA: Final = """\
end = time.monotonic() + 30
if os.fork() == 0:
    # A new process in a new session every 2 ms, whose parent is gone.
    while time.monotonic() < end:
        if os.fork():
            os._exit(0)
        os.setsid()
        time.sleep(0.002)
    os._exit(0)
time.sleep(0.2)
os._exit(5)
"""
BRIM: Final = """\
global hog
hog, size = [], 1 << 24
while size >= 64:
    try:
        while True:
            hog.append(bytearray(size))
    except MemoryError:
        size //= 2
"""
SLEEPS: Final = "subprocess.Popen(['sleep', '600'])\n"
LEAVES: Final = "    subprocess.Popen(['sleep', '600'], start_new_session=True)\n"
NATIVE_HOG: Final = """\
print("terminate called after throwing an instance of 'std::bad_alloc'", flush=True)
os.abort()
"""
OUT_OF_MEMORY: Final = "more than the 0.5 GiB of memory that it is allowed (memory_limit)"
# Name -> what the script does when it is asked, the limits of the scenario, title of the error, and its cause.
TRICKS: Final = {
    "kills the group of its parent": (
        f"{SLEEPS}os.killpg(os.getpgid(os.getppid()), signal.SIGKILL)\ntime.sleep(600)",
        "",
        "SIGKILL",
        "ended by SIGKILL",
    ),
    "kills its group": (f"{SLEEPS}os.killpg(0, signal.SIGKILL)", "", "SIGKILL", "ended by SIGKILL"),
    "ends its parent": (
        f"{SLEEPS}os.kill(os.getppid(), signal.SIGTERM)\ntime.sleep(600)",
        "",
        "SIGTERM",
        "ended by SIGTERM",
    ),
    "stops its parent": (
        f"{SLEEPS}os.kill(os.getppid(), signal.SIGSTOP)\ntime.sleep(600)",
        "wall_limit: 2 s",
        "wall limit",
        "no verdict after 2 s of wall time",
    ),
    "hydra": (HYDRA, "", "exit 5", ""),
    "daemon": ("if observation.time == 0 and os.fork(): os._exit(0)", "", "exit 0", ""),
    "flood": ("subprocess.run(['yes'])", "output_limit: 10 MB", "output limit", ""),
    "bloat": ("open('bloat', 'wb').truncate(2 << 30)", "memory_limit: 1 GiB", "script error", "File too large"),
    "native hog": (NATIVE_HOG, "", "out of memory", "more than the 4 GiB of memory"),
    **{
        f"brim {engine}": (BRIM, f"memory_limit: 512 MiB\nbackend: {engine}", "out of memory", OUT_OF_MEMORY)
        for engine in installed()
    },
}


def test_tricks_cost_their_own_scenario_and_nothing_else(tmp_path: Path) -> None:
    for name, (body, limits, _, _) in TRICKS.items():
        script(tmp_path, name, body, limits)
    for number in range(2):
        (tmp_path / f"{number}.sim.yml").write_text(HONEST.format(number=number))
    script(tmp_path, "untidy", f"if observation.time == 0:\n{LEAVES}{LEAVES}")
    script(tmp_path, "twin", "if observation.time == 0 and os.fork() == 0:\n    raise RuntimeError('the copy')")
    found = outcomes(tmp_path)
    # Asked at once: the call itself must have waited for all of them.
    assert processes_of(tmp_path) == []
    passed = {"honest 0", "honest 1", "untidy", "twin"}
    assert {name for name, outcome in found.items() if outcome.status == "passed"} == passed
    assert "ended 2 processes that its script left behind" in found["untidy"].notes
    assert found.keys() == passed | TRICKS.keys()
    for name, (_, _, title, cause) in TRICKS.items():
        (failure,) = found[name].failures
        assert (name, failure.title) == (name, title), failure
        assert cause in failure.message
    assert {found[name].failures[0].kind for name in found if "hog" in name or "brim" in name} == {"memory"}
    assert found["flood"].failures[0].details.split() == ["y"] * 20
    assert len(found["flood"].output) < 100_000
    assert (tmp_path / "bloat").stat().st_size == 0


def test_a_call_that_is_killed_outright_leaves_no_process(tmp_path: Path) -> None:
    script(tmp_path, "hider", "subprocess.Popen(['sleep', '600'], start_new_session=True)\ntime.sleep(600)")
    run = start(tmp_path)
    # The call, the supervisor, the scenario, and what it hides.
    wait_for(4, tmp_path)
    run.kill()
    run.communicate(timeout=PATIENCE)
    wait_for(0, tmp_path)
