"""Real children that die, hang, hog and fork: each an error with its cause, and nobody else is touched."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Final

import pytest

from sim_action.core.errors import Location
from sim_action.core.process import Interruption
from sim_action.results.journal import Event, RunEnded
from sim_action.results.outcome import Outcome
from sim_action.runner.isolation.child_process import ChildProcess
from sim_action.runner.isolation.linux_child import LinuxChild
from sim_action.runner.isolation.portable_child import PortableChild
from sim_action.scenario.loading import load_scenario
from tests.integration.marked_processes import wait_for
from tests.pool import execute
from tests.scenarios import driving
from tests.soak import soaked

GOOD = "{twist: [{linear: 0.5}]}"


def silent(event: Event) -> None: ...


def scenario(folder: Path, name: str, commands: str = GOOD, wall_limit: float = 60) -> Path:
    path = folder / f"{name}.sim.yml"
    text = driving(name, commands).replace("m}}]", "m}}, no_collision]")
    path.write_text(f"{text}wall_limit: {wall_limit} s\n")
    return path


def script(folder: Path, name: str, body: str, wall_limit: float = 60, before: str = "") -> Path:
    lines = "\n".join(f"    {line}" for line in body.splitlines())
    (folder / f"{name}.py").write_text(
        f"from sim_action import JointTargets, Twist\n{before}\ndef control(observation):\n{lines}\n"
    )
    return scenario(folder, name, f"{{script: {name}.py}}", wall_limit)


Run = Callable[..., list[Outcome]]


def run_in(way: type[ChildProcess], paths: list[Path], folder: Path, jobs: int = 2) -> list[Outcome]:
    """Run scenarios in one of the ways that there are."""
    scenarios = [load_scenario(path) for path in paths]
    with Interruption() as interruption:
        return execute(scenarios, folder / "results", jobs, silent, interruption, child_type=way)


def test_while_children_run_the_caller_is_made_ready_once(tmp_path: Path) -> None:
    told: list[str] = []

    def tell(event: Event) -> None:
        if isinstance(event, RunEnded):
            told.append(event.outcome.status)

    scenarios = [load_scenario(scenario(tmp_path, name)) for name in "abc"]
    with Interruption() as interruption:
        execute(scenarios, tmp_path, 1, tell, interruption, meanwhile=lambda: told.append("ready"))
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
        execute([loaded], tmp_path, 1, silent, interruption, meanwhile=fail)
    assert born != [before]
    assert children() == before


WAYS: Final = (LinuxChild, PortableChild)
NAMES: Final = ("linux", "portable")
on_both = pytest.mark.parametrize("run", WAYS, indirect=True, ids=NAMES)  # also without `--soak` in both ways


@pytest.fixture(params=soaked(WAYS, short=WAYS[:1]), ids=NAMES)
def run(request: pytest.FixtureRequest) -> Run:
    return partial(run_in, request.param)


BALL: Final = "{name: ball, sphere: {radius: 0.1}, pose: {x: 0.05}, appears: 0.1 s}"
WITHOUT_VERDICT: Mapping[str, tuple[str, str, str]] = {
    "unstable": ("physics: {max_speed: 1 cm/s}", "unstable", "model: turtlebot3_burger"),
    "appears": (f"world: {{objects: [{BALL}]}}", "engine", "appears: 0.1 s"),
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
    file, line, column = (getattr(failure.location, name) for name in ("file", "line", "column"))
    assert Path(file).read_text().splitlines()[line - 1][column - 1 :].startswith(key)


HANGS = """import time
class Level:
    kind = "invariant"
    def judge(self, trace):
        return wait()
def wait():
    time.sleep(600)
"""


def test_user_code_that_does_not_end_is_told_with_its_line(tmp_path: Path, run: Run) -> None:
    (tmp_path / "level.py").write_text(HANGS)
    paths = [script(tmp_path, "hang", "import time; time.sleep(600)", wall_limit=20)]
    for name, asked in (("alone", "assertion: level.py:Level"), ("negated", "not: {assertion: 'level.py:Level'}")):
        path = scenario(tmp_path, name, wall_limit=20)
        path.write_text(path.read_text().replace("no_collision", f"{{{asked}}}"))
        paths.append(path)
    controller, *assertions = (outcome.failures[0] for outcome in run(paths, tmp_path, jobs=3))
    assert controller.location == Location(str(tmp_path / "hang.py"), 4)
    for failure in assertions:
        assert failure.kind == "wall limit"
        assert failure.location == Location(str(tmp_path / "level.py"), 7)
        assert "level.py:7 did not return or a limit that is too low" in failure.message


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


DRIVE: Final = "return Twist.planar(0.5)"
CLOCKS: Final = """\
import itertools, time
time.time, time.perf_counter, time.monotonic = lambda: 1e300, itertools.count(1e6, -1.0).__next__, lambda: 5.0
"""
PIPED: Final = """\
if isinstance(files.{0}, int):
    os.dup2(os.pipe()[0], files.{0})
else:
    files.{0}.unlink(missing_ok=True)
    os.mkfifo(files.{0})
os._exit(0)
"""
STREAMS: Final = {
    "unfit": "class Tee:\n    def write(self, text): pass\nsys.stdout, sys.stderr = None, Tee()",
    "failing": "class Tee:\n    def flush(self): raise RuntimeError('never flush me')\nsys.stdout = Tee()",
}
DIES_LATE: Final = """\
import os, signal, sys
class Last:
    def write(self, text): pass
    def flush(self): os.kill(os.getpid(), signal.SIGKILL)
sys.stdout = Last()
"""
# Name -> what the controller does, and what stands before it.
SCRIPTS: Final[Mapping[str, tuple[str, str]]] = {
    "words": ("if observation.time > 1:\n    print('wheel came off', flush=True)\n    import os; os.abort()", ""),
    "raises": ("x = 1\nreturn x / 0", ""),
    "imports": ("return None", "import nowhere_to_be_found"),
    "outcome": (FORGED + PIPED.format("outcome"), ""),
    "output": (FORGED + PIPED.format("output"), ""),
    # A thread that goes on holds no verdict up.
    "nosy": (
        f"import os\nprint(sorted(n for n, v in os.environ.items() if v == 'secret'))\n{DRIVE}",
        "import threading, time\nthreading.Thread(target=time.sleep, args=(600,)).start()",
    ),
    "stopper": ("return Twist.planar(0.0 if observation.pose.position_xyz[0] > 0.3 else 0.4)", ""),
    "clocks": (
        "return JointTargets(velocity=dict.fromkeys(('wheel_left_joint', 'wheel_right_joint'), 0.2 / 0.033))",
        CLOCKS,
    ),
    **{name: (DRIVE, f"import sys\n{text}") for name, text in STREAMS.items()},
    "dies": (DRIVE, DIES_LATE),
}


@pytest.fixture(scope="module", params=soaked(WAYS, short=WAYS[:1]), ids=NAMES)
def ran(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Outcome]:
    """The outcomes of all SCRIPTS in one call, where variables have the value `secret` that no script may see."""
    folder = tmp_path_factory.mktemp("scripts")
    # Only Linux keeps a verdict whose process is killed after it.
    paths = [
        script(folder, name, body, before=before)
        for name, (body, before) in SCRIPTS.items()
        if request.param is LinuxChild or (name != "dies" and name not in STREAMS)
    ]
    stops = folder / "stopper.sim.yml"
    stops.write_text(stops.read_text() + "duration: 4 s\n")
    with pytest.MonkeyPatch.context() as patch:
        for name in ("GITHUB_TOKEN", "GITHUB_ENV", "GITHUB_OUTPUT", "ACTIONS_RUNTIME_TOKEN", "INPUT_SCENARIO"):
            patch.setenv(name, "secret")
        return {outcome.name: outcome for outcome in run_in(request.param, paths, folder)}


def test_what_scripts_do_to_their_process_changes_no_verdict(ran: dict[str, Outcome]) -> None:
    passed = {name for name, outcome in ran.items() if outcome.status == "passed"}
    assert ran.keys() - passed == {"words", "raises", "imports", "outcome", "output"}
    assert set(ran["nosy"].output.split("\n")) == {"[]"}
    # It sees that it is past 0.3 m at a tick, and stops from 0.4 m/s within 0.08 m.
    assert 0.3 < (ran["stopper"].travelled or 0) < 0.3 + 0.04 + 0.08 + 0.01
    assert 0 < ran["clocks"].wall_time < 3600
    assert "dies" not in ran or "after the verdict, its process ended: SIGKILL" in ran["dies"].notes


def test_errors_of_scripts_keep_last_words_and_name_the_users_line(ran: dict[str, Outcome]) -> None:
    for name, line in (("raises", 5), ("imports", 2)):
        assert str(ran[name].failures[0].location).endswith(f"{name}.py:{line}")
    assert "nowhere_to_be_found" in ran["imports"].failures[0].message
    assert "wheel came off" in ran["words"].failures[0].details
    assert "wheel came off" in ran["words"].output


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
    assert str(failure.location).startswith("sub/killer.py:")
    named = re.findall(r'File "(.*)", line \d+, in (\w+)', failure.details)
    assert named == [("killer.py", "control"), ("killer.py", "helper")]


@on_both
def test_processes_that_a_script_leaves_behind_are_ended(tmp_path: Path, run: Run) -> None:
    body = (
        "import os, subprocess, pathlib\n"
        "here = pathlib.Path(__file__).parent\n"
        "if not (here / 'left').exists():\n"
        "    (here / 'left').touch()\n"
        "    subprocess.Popen(['sleep', '600'], env={**os.environ, 'ROS_MARK': str(here)})\n"
        "return Twist.planar(0.5)"
    )
    (outcome,) = run([script(tmp_path, "forker", body)], tmp_path)
    assert outcome.status == "passed"
    wait_for(0, tmp_path)


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
    (in_wall, in_ground) = refused.failures
    assert in_wall.kind == in_ground.kind == "invalid"
    assert "m inside 'wall'; move it, or world.objects[0].pose" in in_wall.message
    assert "0.02 m inside the ground" in in_ground.message
    assert "bad.sim.yml:4:" in str(in_wall.location)


def test_a_child_that_is_killed_leaves_no_file_in_the_systems_folder(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    monkeypatch.setattr(tempfile, "tempdir", None)
    kept = tmp_path / "kept"
    keep = f"pathlib.Path({str(kept)!r}).write_text(tempfile.mkdtemp())"
    body = f"import os, pathlib, tempfile\n{keep}\nos.kill(os.getpid(), 9)"
    [outcome] = run([script(tmp_path, "killed", body)], tmp_path)
    assert [failure.title for failure in outcome.failures] == ["SIGKILL"]
    assert Path(kept.read_text()).is_relative_to(temporary)
    assert not list(temporary.iterdir())
