"""A suite with ten scenarios that kill, hang, hog, flood and hide: real processes, two at a time.

Everyone else gets a verdict, each of the ten an error with its cause, and no process is left.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Final

import junitparser

from sim_action.engines import installed
from sim_action.results.results_json import Results
from tests.integration.conftest import outside_of_github
from tests.integration.marked_processes import processes_of, wait_for
from tests.patience import PATIENCE

HONEST: Final = """\
name: {name}
robot: {{model: turtlebot3_burger}}
physics: {{settle: 0}}
expect: [upright]
time_limit: 0.1 s
"""

LEAVES_A_SESSION: Final = """\
reader, writer = os.pipe()
if os.fork() == 0:
    os.setsid()
    for _ in range(3):
        os.fork()
    os.write(writer, b".")
    time.sleep(600)
born = 0
while born < 8:
    born += len(os.read(reader, 8))
os.abort()
"""

HOGS: Final = "hog = [bytearray(1 << 26) for _ in range(1000)]"
FORKS: Final = "if os.fork() == 0: time.sleep(600)\nos._exit(7)"
FLOODS: Final = "while True: print('flood ' * 100)"
CLOSED: Final = "closed file descriptors of sim-action: 1 (standard output), 2 (standard error)"
# Name -> what the script does when it is asked, the limits of the scenario, the kind of the error, and its cause.
KILLERS: Final = {
    "segfault": ("os.kill(os.getpid(), signal.SIGSEGV)", "", "crash", "ended by SIGSEGV: native code crashed"),
    "abort": ("print('last words', flush=True); os.abort()", "", "crash", "ended by SIGABRT"),
    "endless loop": ("while True: pass", "wall_limit: 1 s", "wall limit", "no verdict after 1 s of wall time"),
    "memory hog": (
        HOGS,
        "memory_limit: 1 GiB",
        "memory",
        "more than the 1 GiB of memory that it is allowed (memory_limit)",
    ),
    "exit": ("os._exit(0)", "", "crash", "exit.py:4 called os._exit(0): the process of this"),
    "forks and leaves": (
        FORKS,
        "",
        "crash",
        "its last report was at 0.00 s of sim time; ended a process that its script",
    ),
    "leaves a session": (LEAVES_A_SESSION, "", "crash", "ended 8 processes that its script left behind"),
    "endless output": (FLOODS, "output_limit: 1 MB", "crash", "more than 1 MB were printed (output_limit)"),
    "system exit": ("raise SystemExit", "", "script", "the controller raised SystemExit"),
    "closes descriptors": ("os.closerange(0, 4096)", "", "script", CLOSED),
}


def script(folder: Path, name: str, body: str, limits: str = "") -> Path:
    lines = "\n".join(f"    {line}" for line in body.splitlines())
    stem = name.replace(" ", "_")
    (folder / f"{stem}.py").write_text(
        f"import os, signal, subprocess, sys, time\n\ndef control(observation):\n{lines}\n"
    )
    path = folder / f"{stem}.sim.yml"
    path.write_text(f"{HONEST.format(name=name)}commands: {{script: {stem}.py}}\n{limits}\n")
    return path


def write_suite(folder: Path, total: int) -> None:
    """Killers among the others, so that each runs beside one that is honest."""
    for number in range(total - len(KILLERS)):
        (folder / f"{number:03}.sim.yml").write_text(HONEST.format(name=f"honest {number}"))
    for index, (name, (body, limits, _, _)) in enumerate(KILLERS.items()):
        path = script(folder, name, body, limits)
        path.rename(folder / f"{index * (total - len(KILLERS)) // len(KILLERS):03}-{path.name}")


def start(folder: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "sim_action", "run", ".", "--jobs", "2"],
        cwd=folder,
        env=outside_of_github({"ROS_MARK": str(folder)}),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def results_of(folder: Path) -> Results:
    """The results of a run whose scenarios do not all pass; it leaves no process."""
    run = start(folder)
    run.communicate(timeout=PATIENCE)
    assert run.returncode == 1
    # Asked at once: the call itself must have waited for all of them.
    assert processes_of(folder) == []
    return Results.read(folder / "sim-results/results.json")


def test_ten_killers_cost_ten_scenarios_and_nothing_else(tmp_path: Path) -> None:
    total = 2 * len(KILLERS)
    write_suite(tmp_path, total)
    results = results_of(tmp_path)
    assert (results.total, results.count("passed"), results.count("error")) == (total, total - len(KILLERS), 10)
    failures = {outcome.name: outcome.failures for outcome in results.outcomes if outcome.failures}
    assert failures.keys() == KILLERS.keys()
    for name, (_, _, kind, cause) in KILLERS.items():
        (failure,) = failures[name]
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
KILLS_PARENTS: Final = f"{SLEEPS}os.killpg(os.getpgid(os.getppid()), signal.SIGKILL)\ntime.sleep(600)"
TO_PARENT: Final = SLEEPS + "os.kill(os.getppid(), signal.{})\ntime.sleep(600)"
LEAVES: Final = "    subprocess.Popen(['sleep', '600'], start_new_session=True)\n"
NATIVE_HOG: Final = """\
print("terminate called after throwing an instance of 'std::bad_alloc'", flush=True)
os.abort()
"""
OUT_OF_MEMORY: Final = "more than the 0.5 GiB of memory that it is allowed (memory_limit)"
# Name -> what the script does when it is asked, the limits of the scenario, title of the error, and its cause.
TRICKS: Final = {
    "kills the group of its parent": (KILLS_PARENTS, "", "SIGKILL", "ended by SIGKILL"),
    "kills its group": (f"{SLEEPS}os.killpg(0, signal.SIGKILL)", "", "SIGKILL", "ended by SIGKILL"),
    "ends its parent": (TO_PARENT.format("SIGTERM"), "", "SIGTERM", "ended by SIGTERM"),
    "stops its parent": (
        TO_PARENT.format("SIGSTOP"),
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
        (tmp_path / f"{number}.sim.yml").write_text(HONEST.format(name=f"honest {number}"))
    script(tmp_path, "untidy", f"if observation.time == 0:\n{LEAVES}{LEAVES}")
    script(tmp_path, "twin", "if observation.time == 0 and os.fork() == 0:\n    raise RuntimeError('the copy')")
    ended = {outcome.name: outcome for outcome in results_of(tmp_path).outcomes}
    passed = {"honest 0", "honest 1", "untidy", "twin"}
    assert {name for name, outcome in ended.items() if outcome.status == "passed"} == passed
    assert "ended 2 processes that its script left behind" in ended["untidy"].notes
    assert ended.keys() == passed | TRICKS.keys()
    for name, (_, _, title, cause) in TRICKS.items():
        (failure,) = ended[name].failures
        assert (name, failure.title) == (name, title), failure
        assert cause in failure.message
    assert {ended[name].failures[0].kind for name in ended if "hog" in name or "brim" in name} == {"memory"}
    assert ended["flood"].failures[0].details.split() == ["y"] * 20
    assert len(ended["flood"].output) < 100_000
    assert (tmp_path / "bloat").stat().st_size == 0


def test_a_call_that_is_killed_outright_leaves_no_process(tmp_path: Path) -> None:
    script(tmp_path, "hider", "subprocess.Popen(['sleep', '600'], start_new_session=True)\ntime.sleep(600)")
    run = start(tmp_path)
    # The call, the supervisor, the scenario, and what it hides.
    wait_for(4, tmp_path)
    run.kill()
    run.communicate(timeout=PATIENCE)
    wait_for(0, tmp_path)
