"""Real children that die, hang, hog and fork: each an error with its cause, and nobody else is touched."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import pytest

from sim_action.core.errors import Location
from sim_action.core.process import Interruption
from sim_action.results.events import Event, RunEnded
from sim_action.results.outcome import Outcome
from sim_action.runner.isolation.child_process import ChildProcess
from sim_action.runner.isolation.linux_child import LinuxChild
from sim_action.runner.isolation.portable_child import PortableChild
from sim_action.scenario.loading import load_scenario
from sim_action.state.trace_storage import load_trace
from tests.patience import PATIENCE, wait_until
from tests.pool import execute
from tests.soak import soaked

SCENARIO = """
name: {name}
robot: {{model: turtlebot3_burger}}
commands: {commands}
expect: [{{travel: {{at_least: 0.1 m}}}}, no_collision]
time_limit: 5 s
wall_limit: {wall_limit} s
"""

GOOD = "{twist: [{linear: 0.5}]}"


class Silent:
    def __call__(self, event: Event) -> None: ...


def scenario(folder: Path, name: str, commands: str = GOOD, wall_limit: float = 60) -> Path:
    path = folder / f"{name}.sim.yml"
    path.write_text(SCENARIO.format(name=name, commands=commands, wall_limit=wall_limit))
    return path


def script(folder: Path, name: str, body: str, wall_limit: float = 60, before: str = "") -> Path:
    lines = "\n".join(f"    {line}" for line in body.splitlines())
    (folder / f"{name}.py").write_text(
        f"from sim_action import JointTargets, Twist\n{before}\ndef control(observation):\n{lines}\n"
    )
    return scenario(folder, name, f"{{script: {name}.py}}", wall_limit)


@dataclass(frozen=True)
class Run:
    """Runs scenarios in one of the ways that there are."""

    way: type[ChildProcess]

    def __call__(self, paths: list[Path], folder: Path, jobs: int = 2) -> list[Outcome]:
        scenarios = [load_scenario(path) for path in paths]
        with Interruption() as interruption:
            return execute(scenarios, folder / "results", jobs, Silent(), interruption, child_type=self.way)


def test_while_children_run_the_caller_is_made_ready_once(tmp_path: Path) -> None:
    told: list[str] = []

    class Told(Silent):
        def __call__(self, event: Event) -> None:
            if isinstance(event, RunEnded):
                told.append(event.outcome.status)

    scenarios = [load_scenario(scenario(tmp_path, name)) for name in "abc"]
    with Interruption() as interruption:
        execute(scenarios, tmp_path, 1, Told(), interruption, meanwhile=lambda: told.append("ready"))
    assert told == ["ready", "passed", "passed", "passed"]


def test_a_caller_that_is_not_made_ready_leaves_no_children(tmp_path: Path) -> None:
    loaded = load_scenario(scenario(tmp_path, "alone"))
    born: list[str] = []

    def children() -> str:
        return Path(f"/proc/self/task/{os.getpid()}/children").read_text()

    def fail() -> None:
        born.append(children())
        raise RuntimeError("not today")

    before = children()  # the warm process of other tests, if they ran here
    with Interruption() as interruption, pytest.raises(RuntimeError, match="not today"):
        execute([loaded], tmp_path, 1, Silent(), interruption, meanwhile=fail)
    assert born != [before]
    assert children() == before


WAYS: Final = (LinuxChild, PortableChild)
NAMES: Final = ("linux", "portable")

on_both = pytest.mark.parametrize("run", WAYS, indirect=True, ids=NAMES)
"""Also without `--soak` in both ways; tests/integration/test_other_systems.py has the second one, too."""


@pytest.fixture(params=soaked(WAYS, short=WAYS[:1]), ids=NAMES)
def run(request: pytest.FixtureRequest) -> Run:
    return Run(request.param)


def processes_of(marker: Path) -> list[int]:
    """Processes whose environment or working directory points below a test's own folder."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            try:
                if str(marker) in str((entry / "cwd").readlink()):
                    found.append(int(entry.name))
            except OSError:
                continue
    return found


DEATHS: Mapping[str, tuple[str, str, str, float]] = {
    "segfault": ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "crash", "SIGSEGV", 60),
    "abort": ("import os; print('last words', flush=True); os.abort()", "crash", "SIGABRT", 60),
    "exit zero": ("import os; os._exit(0)", "crash", "exit code 0", 60),
    "hang": ("while True: pass", "wall limit", "after 2 s of wall time", 2),
    "hog": ("hog = [bytearray(1 << 28) for _ in range(1000)]", "memory", "MemoryError", 60),
    "raise": ("return 1 / 0", "script", "ZeroDivisionError", 60),
    "sys exit": ("import sys; sys.exit(0)", "script", "SystemExit", 60),
    "nonsense": ("return 'forward'", "script", "returned a str", 60),
    "not a number": ("return Twist.planar(float('nan'))", "script", "has a value that is not finite", 60),
    "unknown joint": ("return JointTargets(velocity={'wheel_lft_joint': 1.0})", "script", "wheel_left_joint", 60),
}


@on_both
def test_a_dead_child_is_an_error_with_its_cause_and_the_others_pass(tmp_path: Path, run: Run) -> None:
    # Where nothing holds a script to its limit, one would take the memory of this machine.
    deaths = {name: death for name, death in DEATHS.items() if death[1] != "memory" or run.way.limits_memory}
    # Each of those that die has one beside it that does not.
    paths = [scenario(tmp_path, "good")]
    for number, (name, (body, _, _, wall_limit)) in enumerate(deaths.items()):
        path = script(tmp_path, name.replace(" ", "_"), body, wall_limit)
        path.write_text(path.read_text() + "memory_limit: 1 GiB\n")
        paths += [path, *([scenario(tmp_path, f"good {number}")] if number % 3 == 2 else [])]
    outcomes = {outcome.name: outcome for outcome in run(paths, tmp_path)}
    for name, (_, kind, cause, _) in deaths.items():
        killer = outcomes.pop(name.replace(" ", "_"))
        assert killer.status == "error"
        (failure,) = killer.failures
        assert (name, failure.kind) == (name, kind)
        assert cause in f"{failure.title} {failure.message}"
    assert len(outcomes) == len(deaths) // 3 + 1
    assert {outcome.status for outcome in outcomes.values()} == {"passed"}


@on_both
def test_where_no_controller_runs_none_is_stuck(tmp_path: Path, run: Run) -> None:
    (tmp_path / "endless.xacro").write_text(
        '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="${9**9**9}"/></robot>'
    )
    path = scenario(tmp_path, "xacro", wall_limit=2)
    path.write_text(path.read_text().replace("turtlebot3_burger", "endless.xacro"))
    (outcome,) = run([path], tmp_path)
    (failure,) = outcome.failures
    assert failure.kind == "wall limit"
    assert (
        "after 2 s of wall time (wall_limit): xacro that does not terminate or a limit that is too low;"
        in failure.message
    )


WITHOUT_VERDICT: Mapping[str, tuple[str, str, str]] = {
    "unstable": ("physics: {max_speed: 1 cm/s}", "unstable", "model: turtlebot3_burger"),
    "appears": (
        "world: {objects: [{name: ball, sphere: {radius: 0.1}, pose: {x: 0.05}, appears: 0.1 s}]}",
        "engine",
        "appears: 0.1 s",
    ),
    "wall limit": ("wall_limit: 1 ms", "wall limit", "wall_limit: 1 ms"),
    "of its base": ("x-none", "wall limit", "wall_limit: 1 ms"),
}


@pytest.mark.parametrize("cause", WITHOUT_VERDICT)
def test_an_end_without_a_verdict_points_at_the_key_to_change(tmp_path: Path, run: Run, cause: str) -> None:
    keys, kind, key = WITHOUT_VERDICT[cause]
    path = scenario(tmp_path, "s")
    text = path.read_text().replace("wall_limit: 60 s", keys)
    if cause == "of its base":
        # What is stated in a file that it extends is mended there.
        (tmp_path / "base.sim.yml").write_text("wall_limit: 1 ms\n")
        text = text.replace("x-none", "extends: base.sim.yml")
    path.write_text(text)
    (outcome,) = run([path], tmp_path)
    (failure,) = outcome.failures
    assert failure.kind == kind
    assert failure.location is not None
    assert failure.location.column is not None
    assert failure.location.line is not None
    line = Path(failure.location.file).read_text().splitlines()[failure.location.line - 1]
    assert line[failure.location.column - 1 :].startswith(key)


HANGS = """import time

class Level:
    kind = "invariant"

    def judge(self, trace):
        return wait()

def wait():
    time.sleep(600)
"""


@pytest.mark.parametrize("asked", ["assertion: level.py:Level", "not: {assertion: 'level.py:Level'}"])
def test_an_assertion_that_does_not_end_is_told_with_its_line(tmp_path: Path, run: Run, asked: str) -> None:
    (tmp_path / "level.py").write_text(HANGS)
    path = scenario(tmp_path, "s", wall_limit=5)
    path.write_text(path.read_text().replace("no_collision", f"{{{asked}}}"))
    (outcome,) = run([path], tmp_path)
    (failure,) = outcome.failures
    assert failure.kind == "wall limit"
    assert failure.location == Location(str(tmp_path / "level.py"), 10)
    assert "level.py:10 did not return or a limit that is too low" in failure.message


def test_a_controller_that_does_not_end_is_told_with_its_line(tmp_path: Path, run: Run) -> None:
    (outcome,) = run([script(tmp_path, "hang", "while True: pass", wall_limit=5)], tmp_path)
    (failure,) = outcome.failures
    assert failure.location == Location(str(tmp_path / "hang.py"), 4)


@on_both
def test_a_killed_child_leaves_no_unfinished_file(tmp_path: Path, run: Run) -> None:
    folder = tmp_path / "results/replays"
    body = (
        f"folder = pathlib.Path({str(folder)!r})\nfolder.mkdir(parents=True, exist_ok=True)\n"
        "(folder / '.0123456789abcdef.gz').touch()\nos.kill(os.getpid(), signal.SIGKILL)"
    )
    (outcome,) = run([script(tmp_path, "killed", body, before="import os, pathlib, signal")], tmp_path)
    assert outcome.status == "error"
    assert list(folder.iterdir()) == []


FORGED = """\
import json, os, sys
frame = sys._getframe()
while 'files' not in frame.f_locals:
    frame = frame.f_back
files, writer = frame.f_locals['files'], frame.f_locals['writer']
"""


@on_both
def test_a_verdict_that_a_script_forges_is_none(tmp_path: Path, run: Run) -> None:
    body = (
        FORGED
        + "forged = {'name': '::error::x', 'file': '/etc/shadow', 'status': 'passed', 'trace': '/etc/passwd'}\n"
        + "writer.write(json.dumps(forged).encode())\nos._exit(0)"
    )
    (outcome,) = run([script(tmp_path, "forger", body)], tmp_path)
    assert (outcome.name, Path(outcome.file).name, outcome.status) == ("forger", "forger.sim.yml", "error")
    assert outcome.trace is None


@pytest.mark.parametrize("victim", ["outcome", "output"])
def test_a_pipe_in_the_place_of_a_file_holds_nobody_up(tmp_path: Path, run: Run, victim: str) -> None:
    in_folder = f"files.{victim}.unlink(missing_ok=True)\n    os.mkfifo(files.{victim})"
    in_memory = f"os.dup2(os.pipe()[0], files.{victim})"
    body = f"{FORGED}if isinstance(files.{victim}, int):\n    {in_memory}\nelse:\n    {in_folder}\nos._exit(0)"
    (outcome,) = run([script(tmp_path, "piper", body)], tmp_path)
    assert outcome.status == "error"


def test_a_thread_that_a_script_leaves_running_holds_no_verdict_up(tmp_path: Path, run: Run) -> None:
    before = "import threading, time\nthreading.Thread(target=time.sleep, args=(600,)).start()"
    path = script(tmp_path, "threads", "return Twist.planar(0.5)", wall_limit=20, before=before)
    (outcome,) = run([path], tmp_path)
    assert outcome.status == "passed"


def test_last_words_and_sim_time_are_kept(tmp_path: Path, run: Run) -> None:
    body = "if observation.time > 1:\n    print('wheel came off', flush=True)\n    import os; os.abort()"
    (outcome,) = run([script(tmp_path, "killer", body)], tmp_path)
    assert "wheel came off" in outcome.failures[0].details
    assert "wheel came off" in outcome.output


def test_a_script_error_names_the_users_file_and_line(tmp_path: Path, run: Run) -> None:
    (outcome,) = run([script(tmp_path, "killer", "x = 1\nreturn x / 0")], tmp_path)
    location = outcome.failures[0].location
    assert location is not None
    assert (Path(location.file).name, location.line) == ("killer.py", 5)


def test_a_script_error_tells_when_it_was_and_how_it_came_there(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also of a script that went to another folder; files are named as those of scenarios are, from the call's."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sub").mkdir()
    before = "import os\nos.chdir(os.path.dirname(__file__))\ndef helper(x):\n    return 1 / x"
    body = "if observation.time > 0.35:\n    return helper(0)"
    (outcome,) = run([script(tmp_path / "sub", "killer", body, before=before)], tmp_path)
    (failure,) = outcome.failures
    assert failure.message.startswith("at 0.4 s of sim time, the controller raised ZeroDivisionError")
    assert failure.location is not None
    assert failure.location.file == "sub/killer.py"
    named = [line.strip() for line in failure.details.splitlines() if "File" in line]
    assert [line.split(", ")[0] for line in named] == 2 * ['File "killer.py"']
    assert [line.split(", ")[2] for line in named] == ["in control", "in helper"]


def test_an_error_at_import_names_the_users_line(tmp_path: Path, run: Run) -> None:
    (outcome,) = run([script(tmp_path, "killer", "return None", before="import nowhere_to_be_found")], tmp_path)
    location = outcome.failures[0].location
    assert location is not None
    assert location.line == 2
    assert "nowhere_to_be_found" in outcome.failures[0].message


@on_both
def test_processes_that_a_script_leaves_behind_are_ended(tmp_path: Path, run: Run) -> None:
    body = (
        "import os, subprocess, sys, pathlib\n"
        "here = pathlib.Path(__file__).parent\n"
        "if not (here / 'left').exists():\n"
        "    (here / 'left').touch()\n"
        "    subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'], cwd=here)\n"
        "return Twist.planar(0.5)"
    )
    (outcome,) = run([script(tmp_path, "forker", body)], tmp_path)
    assert outcome.status == "passed"
    wait_until(lambda: processes_of(tmp_path) == [])


def test_a_script_does_not_see_what_it_could_act_with(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("GITHUB_TOKEN", "GITHUB_ENV", "GITHUB_OUTPUT", "ACTIONS_RUNTIME_TOKEN", "INPUT_SCENARIO"):
        monkeypatch.setenv(name, "secret")
    body = "import os\nprint(sorted(n for n, v in os.environ.items() if v == 'secret'))\nreturn Twist.planar(0.5)"
    (outcome,) = run([script(tmp_path, "nosy", body)], tmp_path)
    assert outcome.status == "passed"
    assert set(outcome.output.split("\n")) == {"[]"}


def test_a_controller_closes_the_loop(tmp_path: Path, run: Run) -> None:
    body = "return Twist.planar(0.0 if observation.pose.position_xyz[0] > 0.3 else 0.4)"
    path = script(tmp_path, "stopper", body)
    path.write_text(path.read_text().replace("time_limit: 5 s", "duration: 4 s\ntime_limit: 5 s"))
    (outcome,) = run([path], tmp_path)
    assert outcome.status == "passed"
    # It sees that it is past 0.3 m at a tick, and stops from 0.4 m/s within 0.08 m.
    assert outcome.travelled is not None
    assert 0.3 < outcome.travelled < 0.3 + 0.04 + 0.08 + 0.01


def test_joint_targets_drive_as_a_twist_does(tmp_path: Path, run: Run) -> None:
    body = "return JointTargets(velocity=dict.fromkeys(('wheel_left_joint', 'wheel_right_joint'), 0.2 / 0.033))"
    (outcome,) = run([script(tmp_path, "wheels", body)], tmp_path)
    assert outcome.status == "passed"


@pytest.mark.pybullet
def test_what_the_engine_says_becomes_diagnostics(tmp_path: Path, run: Run, capfd: pytest.CaptureFixture[str]) -> None:
    # What sim-action hands the engine gives it nothing to say; what a controller does to it may.
    ask = "try:\n    pybullet.loadURDF('nothing.urdf')\nexcept pybullet.error:\n    pass"
    (outcome,) = run([script(tmp_path, "asks", ask, before="import pybullet")], tmp_path)
    assert outcome.failures == ()
    assert [diagnostic.level for diagnostic in outcome.diagnostics] == ["warning"]
    assert "nothing.urdf" in outcome.diagnostics[0].message
    assert outcome.output == ""
    assert capfd.readouterr() == ("", "")


def test_traces_are_stored_at_the_rate_that_was_asked_for(tmp_path: Path, run: Run) -> None:
    path = scenario(tmp_path, "kept")
    path.write_text(path.read_text() + "trace: {rate: 60 Hz}\n")
    (outcome,) = run([path], tmp_path)
    assert outcome.trace == "traces/kept.npz"
    trace = load_trace(tmp_path / "results" / outcome.trace)
    assert trace.time[1] - trace.time[0] == pytest.approx(1 / 60)
    assert trace.time[-1] == outcome.sim_time


@pytest.mark.parametrize("copies", soaked([2, 8], short=[2]))
def test_many_runs_have_one_digest(tmp_path: Path, run: Run, copies: int) -> None:
    paths = [scenario(tmp_path, f"copy-{index}") for index in range(copies)]
    wall = scenario(tmp_path, "other", "{twist: [{linear: 0.2, angular: 1.0}]}")
    alone = [run([paths[0]], tmp_path / str(index), jobs=1)[0].digest for index in range(copies // 2)]
    together = run([paths[0], wall, *paths[1:]], tmp_path / "together", jobs=1)
    half = copies // 2
    parallel = run([*paths[:half], wall, *paths[half:]], tmp_path / "parallel", jobs=2)
    digests = [o.digest for o in (*together, *parallel) if o.name != "other"]
    assert len(alone) + len(digests) == copies // 2 + 2 * copies
    assert len({*alone, *digests}) == 1


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_reports_what_had_finished(tmp_path: Path, number: signal.Signals) -> None:
    scenario(tmp_path, "a-quick")
    script(tmp_path, "b-endless", "while True: pass")
    scenario(tmp_path, "c-never-started")
    process = subprocess.Popen(
        [sys.executable, "-m", "sim_action", "run", ".", "--jobs", "1"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
    )
    assert process.stdout is not None
    line = process.stdout.readline()
    assert "a-quick" in line
    # The next child is there by now or soon: it never ends by itself.
    wait_until(lambda: processes_of(tmp_path))
    process.send_signal(number)
    process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    junit = (tmp_path / "sim-results" / "junit.xml").read_text()
    assert 'name="a-quick"' in junit
    assert junit.count("<error") == 2
    assert processes_of(tmp_path) == []


@on_both
def test_a_robot_that_begins_inside_something_is_told_on_the_line_to_change_and_spoils_no_other(
    tmp_path: Path, run: Run
) -> None:
    good, bad = scenario(tmp_path, "good"), tmp_path / "bad.sim.yml"
    wall = "{name: wall, box: [0.1, 2.0, 0.5], pose: {x: 0.06}}"
    placed = "  pose: {z: -2 cm}\nworld:\n  objects:\n    - " + wall
    text = good.read_text().replace("name: good", "name: bad").replace("robot: {model", "robot:\n  model")
    bad.write_text(text.replace("burger}", f"burger\n{placed}"))
    passed, refused = run([good, bad], tmp_path)
    assert (passed.status, refused.status, refused.name, refused.exit_code) == ("passed", "error", "bad", 2)
    (wall_failure, ground_failure) = refused.failures
    assert wall_failure.kind == ground_failure.kind == "invalid"
    assert "m inside 'wall'; move it, or world.objects[0].pose" in wall_failure.message
    assert "0.02 m inside the ground" in ground_failure.message
    assert wall_failure.location is not None
    assert (Path(wall_failure.location.file).name, wall_failure.location.line) == ("bad.sim.yml", 5)


def test_a_child_that_is_killed_leaves_no_file_in_the_systems_folder(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    monkeypatch.setattr(tempfile, "tempdir", None)
    kept = tmp_path / "kept"
    keep = f"pathlib.Path({str(kept)!r}).write_text(tempfile.mkdtemp())"
    [outcome] = run(
        [script(tmp_path, "killed", f"import os, pathlib, tempfile\n{keep}\nos.kill(os.getpid(), 9)")], tmp_path
    )
    assert [failure.title for failure in outcome.failures] == ["SIGKILL"]
    assert Path(kept.read_text()).is_relative_to(temporary)
    assert not list(temporary.iterdir())


CLOCKS = {"stands still": "lambda: 5.0", "goes back": "itertools.count(1e6, -1.0).__next__", "jumps": "lambda: 1e300"}


@pytest.mark.parametrize("clock", soaked(CLOCKS, short=["goes back"]))
def test_a_script_that_replaces_the_clocks_changes_no_verdict(tmp_path: Path, run: Run, clock: str) -> None:
    names = ("time", "perf_counter", "monotonic")
    before = "import itertools, time\n" + "".join(f"time.{name} = {CLOCKS[clock]}\n" for name in names)
    (outcome,) = run([script(tmp_path, "clock", "return Twist.planar(0.5)", before=before)], tmp_path)
    assert (outcome.status, outcome.failures) == ("passed", ())
    assert 0 < outcome.wall_time < 3600


STREAMS = {
    "without": "sys.stdout = None",
    "unfit": "class Tee:\n    def write(self, text): pass\nsys.stderr = Tee()",
    "failing": "class Tee:\n    def flush(self): raise RuntimeError('never flush me')\nsys.stdout = Tee()",
}


@pytest.mark.parametrize("way", STREAMS)
def test_streams_that_user_code_replaces_lose_no_verdict(way: str, tmp_path: Path) -> None:
    (outcome,) = Run(LinuxChild)(
        [script(tmp_path, way, "return Twist.planar(0.5)", before=f"import sys\n{STREAMS[way]}")], tmp_path, 1
    )
    assert outcome.status == "passed", outcome.failures


def test_a_process_that_dies_after_its_verdict_keeps_it(tmp_path: Path) -> None:
    body = "global steps\nsteps += 1\nreturn Twist.planar(0.5)"
    before = (
        "import os, signal, sys\nsteps = 0\n"
        "class Last:\n    def write(self, text): pass\n    def flush(self): os.kill(os.getpid(), signal.SIGKILL)\n"
        "sys.stdout = Last()"
    )
    (outcome,) = Run(LinuxChild)([script(tmp_path, "dies", body, before=before)], tmp_path, 1)
    assert outcome.status == "passed", outcome.failures
    assert "after the verdict, its process ended: SIGKILL" in outcome.notes


def test_a_full_disk_behind_standard_error_changes_no_verdict(tmp_path: Path) -> None:
    for name in "abcd":
        scenario(tmp_path, name)
    with Path("/dev/full").open("w") as full:
        ran = subprocess.run(
            [sys.executable, "-m", "sim_action", "run", "--jobs", "1"], cwd=tmp_path, stderr=full, check=False
        )
    assert ran.returncode == 0
