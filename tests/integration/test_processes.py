"""Controllers that are programs: real ones, in several languages, good and bad, in whole runs of the command line."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path
from typing import Final

import pytest

from sim_action.core.errors import Location
from sim_action.engines import installed
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results
from tests.integration.conftest import interpreter, outside_of_github
from tests.integration.marked_processes import processes_of, wait_for
from tests.integration.other_systems import System, variables_of
from tests.soak import soaked

ROOT: Final = Path(__file__).parents[2]

SCENARIO: Final = """\
name: {name}
robot: {{model: turtlebot3_burger}}
world: {{objects: [{{name: wall, box: [0.1, 2.0, 0.5], pose: {{x: 1.5}}}}]}}
commands: {{{source}, rate: 20 Hz}}
expect: [{{reach: {{x: 1.0, y: 0, tolerance: 5 cm}}}}, no_collision]
duration: 6 s
time_limit: 6 s
"""

FUNCTION: Final = """\
from sim_action import Twist

def control(observation):
    x, _, _ = observation.pose.position_xyz
    return Twist.planar(max(0.0, min(0.5, 1.0 - x)), 0.001 * observation.joints["wheel_left_joint"].velocity / 3.0)
"""
CLASS: Final = """\
from sim_action import Twist

class Controller:
    def reset(self, robot):
        self.wheel = next(name for name, joint in robot.joints.items() if joint.moves)

    def step(self, observation):
        x, _, _ = observation.pose.position_xyz
        return Twist.planar(max(0.0, min(0.5, 1.0 - x)), 0.001 * observation.joints[self.wheel].velocity / 3.0)
"""
PYTHON: Final = """\
import json, sys

for line in sys.stdin:
    seen, answer = json.loads(line), {}
    if seen["type"] == "step":
        left = max(0.0, min(0.5, 1.0 - seen["pose"]["position_xyz"][0]))
        answer = {"twist": {"linear": left, "angular": 0.001 * seen["joints"]["wheel_left_joint"]["velocity"] / 3.0}}
    print(json.dumps(answer), flush=True)
"""
NODE: Final = """\
require("readline").createInterface({input: process.stdin}).on("line", line => {
  const seen = JSON.parse(line);
  let answer = {};
  if (seen.type === "step") {
    const linear = Math.max(0, Math.min(0.5, 1 - seen.pose.position_xyz[0]));
    answer = {twist: {linear, angular: 0.001 * seen.joints.wheel_left_joint.velocity / 3}};
  }
  console.log(JSON.stringify(answer));
});
"""
PERL: Final = """\
$| = 1;
while (<STDIN>) {
  if (/"type":"step"/) {
    my ($x) = /"position_xyz":\\[([^,]+)/;
    my ($velocity) = /"wheel_left_joint":\\{"position":[^,]+,"velocity":([^,]+)/;
    my $linear = 1 - $x;
    $linear = 0.5 if $linear > 0.5;
    $linear = 0 if $linear < 0;
    printf "{\\"twist\\": {\\"linear\\": %.17g, \\"angular\\": %.17g}}\\n", $linear, 0.001 * $velocity / 3;
  } else {
    print "{}\\n";
  }
}
"""
LANGUAGES: Final = {
    name: (f"[{name}, ctl{ending}]", ending, text)
    for name, ending, text in (("node", ".js", NODE), ("perl", ".pl", PERL))
    if shutil.which(name)
}
"""Those that there are on this machine, beside Python."""


def write(folder: Path, name: str, source: str, more: str = "") -> None:
    (folder / f"{name}.sim.yml").write_text(SCENARIO.format(name=name, source=source) + more)


def environment(folder: Path) -> dict[str, str]:
    """Of a call whose processes can be told from all others; `python` is the one of these tests."""
    path = os.pathsep.join((str(Path(sys.executable).parent), os.environ.get("PATH", "")))
    return outside_of_github({"PATH": path, "ROS_MARK": str(folder)})


def run(folder: Path, *options: str, paths: str = ".", variables: dict[str, str] | None = None) -> dict[str, Outcome]:
    words = ("run", paths, "--jobs", "2", "--no-report", *options)
    interpreter(folder, "-m", "sim_action", *words, env=variables or environment(folder))
    return {outcome.name: outcome for outcome in Results.read(folder / "sim-results/results.json").outcomes}


def test_there_is_another_language_than_python() -> None:
    assert LANGUAGES, "install perl, or node"


@pytest.mark.parametrize("engine", soaked(installed(), short=installed()[:1]))
def test_the_same_controller_gives_the_same_run_whatever_it_is_written_in_and_however_long_it_takes(
    tmp_path: Path, engine: str
) -> None:
    (tmp_path / "function.py").write_text(FUNCTION)
    (tmp_path / "class.py").write_text(CLASS)
    (tmp_path / "ctl.py").write_text(PYTHON)
    slowly = PYTHON.replace("    print", "    time.sleep(random.random() / 50)\n    print")
    (tmp_path / "slow.py").write_text(slowly.replace("json,", "json, random, time,"))
    for name in ("function", "class"):
        write(tmp_path, name, f"script: {name}.py")
    write(tmp_path, "python", "process: python ctl.py")
    write(tmp_path, "slow", "process: python slow.py")
    for name, (command, ending, text) in LANGUAGES.items():
        (tmp_path / f"ctl{ending}").write_text(text)
        write(tmp_path, name, f"process: {command}")
    outcomes = run(tmp_path, "--backend", engine)
    assert outcomes.keys() == {"function", "class", "python", "slow", *LANGUAGES}
    assert {outcome.status for outcome in outcomes.values()} == {"passed"}, outcomes
    assert len({outcome.digest for outcome in outcomes.values()}) == 1
    assert processes_of(tmp_path) == []


HEAD: Final = """\
import json, os, signal, subprocess, sys, time
def answers(count):
    for _ in range(count):
        sys.stdin.readline()
        print("{}", flush=True)
answers(3)
"""
LEAVE: Final = "if os.fork() == 0:\n    os.setsid()\n    os.fork()\n    time.sleep(600)\n"

# Name -> what it does after three answers, the kind of the failure, and its cause.
BAD: Final = {
    "too slow": ("time.sleep(600)", "script", "did not answer within 5 s of wall time (answer_within)"),
    "raises": (
        "print('hm', file=sys.stderr); {}['speed']",
        "script",
        "exited with code 1 before the end of the run; its last line on standard error: KeyError: 'speed'",
    ),
    "a gigabyte on stderr": (
        "while True: sys.stderr.write('x' * 65536)",
        "crash",
        "more than 1 MB were printed (output_limit)",
    ),
    "killed": ("os.kill(os.getpid(), signal.SIGSEGV)", "script", "was killed by SIGSEGV"),
    "kills its group": ("os.kill(0, signal.SIGKILL)", "script", "was killed by SIGKILL"),
    "kills its parent": ("os.kill(os.getppid(), signal.SIGKILL)\ntime.sleep(600)", "crash", "ended by SIGKILL"),
    "leaves children": (LEAVE + "sys.exit(7)", "script", "exited with code 7"),
    "ignores SIGTERM": (
        "signal.signal(signal.SIGTERM, signal.SIG_IGN)\nwhile True: time.sleep(1)",
        "script",
        "did not answer within 5 s of wall time (answer_within)",
    ),
}
# The same of what it does before it has answered anything.
BAD_STARTS: Final = {
    "raises at the start": (
        "import nowhere_to_be_found",
        "script",
        "exited with code 1 before the end of the run; its last line on standard error: Modul",
    ),
    "forks at the start": (f"import os, time\n{LEAVE}os._exit(7)", "script", "exited with code 7"),
    "never reads": (
        "import time\ntime.sleep(600)\n",
        "script",
        "did not answer within 5 s of wall time (start_within); check that it flushes its output",
    ),
}


def write_bad(folder: Path, name: str, text: str) -> None:
    stem = name.replace(" ", "_")
    (folder / f"{stem}.py").write_text(text)
    # What is told of a program must not depend on how soon a busy machine lets it go on.
    start = 5 if name == "never reads" else 60
    answer = 5 if name in BAD and "within 5 s" in BAD[name][2] else 60
    limits = f"start_within: {start} s, answer_within: {answer} s"
    write(folder, name, f"process: [python, {stem}.py], {limits}", "output_limit: 1 MB\n")


def test_programs_that_misbehave_cost_their_own_scenario_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "ctl.py").write_text(PYTHON)
    write(tmp_path, "0 good", "process: python ctl.py")
    write(tmp_path, "z good", "process: python ctl.py")
    # What outlives its run is ended, and costs no verdict.
    head = "import json, os, sys, time\n"
    (tmp_path / "leaves.py").write_text(PYTHON.replace("import json, sys\n", f"{head}{LEAVE}"))
    (tmp_path / "stays.py").write_text(PYTHON.replace("import json, sys\n", head) + "time.sleep(600)\n")
    for name in ("leaves", "stays"):
        write(tmp_path, name, f"process: python {name}.py")
    for name, (body, _, _) in BAD.items():
        write_bad(tmp_path, name, HEAD + body + "\n")
    for name, (text, _, _) in BAD_STARTS.items():
        write_bad(tmp_path, name, text)
    outcomes = run(tmp_path)
    # Asked at once: the call itself must have waited for all of them.
    assert processes_of(tmp_path) == []
    passed = {"0 good", "z good", "leaves", "stays"}
    assert outcomes.keys() == passed | {*BAD, *BAD_STARTS}
    assert {name for name, outcome in outcomes.items() if outcome.status == "passed"} == passed
    assert any("that its script left behind" in note for note in outcomes["leaves"].notes)
    for name, (_, kind, cause) in {**BAD, **BAD_STARTS}.items():
        (failure,) = outcomes[name].failures
        assert (name, failure.kind) == (name, kind), failure
        assert cause in failure.message
        if kind == "script":
            assert failure.message.startswith("at 0.1 s of sim time, the process" if name in BAD else "the process")
            assert failure.location == Location(f"{name}.sim.yml", 4, 12)
    assert "KeyError: 'speed'" in outcomes["raises"].failures[0].details
    assert outcomes["raises"].output.startswith("hm\n")
    assert len(outcomes["a gigabyte on stderr"].output) < 100_000
    assert outcomes["leaves children"].status == "error"


SEEN: Final = """\
import os
open("seen", "w").write(f"{os.environ['PYTHONPATH']} {os.environ.get('GITHUB_TOKEN', 'none')}")
"""


def test_a_program_sees_no_tokens_and_none_of_our_modules_which_may_be_for_another_python(tmp_path: Path) -> None:
    (tmp_path / "ctl.py").write_text(SEEN + PYTHON)
    write(tmp_path, "curious", "process: python ctl.py")
    outcomes = run(tmp_path, variables={**environment(tmp_path), "GITHUB_TOKEN": "secret"})
    assert outcomes["curious"].status == "passed"
    assert (tmp_path / "seen").read_text() == f"{environment(tmp_path)['PYTHONPATH']} none"


# Scripts run as on the other one in test_other_systems.py.
@pytest.mark.parametrize("system", soaked(["darwin", "win32"], short=["darwin"]))
def test_programs_run_as_on_linux_where_python_has_what_it_has_on_other_systems(tmp_path: Path, system: System) -> None:
    (tmp_path / "ctl.py").write_text(PYTHON)
    write(tmp_path, "good", "process: python ctl.py")
    for name in ("too slow", "raises", "a gigabyte on stderr", "killed"):
        write_bad(tmp_path, name, HEAD + BAD[name][0] + "\n")
    variables = {**environment(tmp_path), **variables_of(system, tmp_path), "ROS_MARK": str(tmp_path)}
    path = os.pathsep.join((str(plain_python(tmp_path)), variables["PATH"]))
    outcomes = run(tmp_path, "--backend", "mujoco", variables={**variables, "PATH": path, "PATHEXT": ".exe"})
    wait_for(0, tmp_path)
    assert outcomes["good"].status == "passed", outcomes["good"]
    for name in ("too slow", "raises", "a gigabyte on stderr"):
        (failure,) = outcomes[name].failures
        assert BAD[name][2] in failure.message
    assert outcomes["killed"].status == "error"
    here = run(tmp_path, "--backend", "mujoco", paths="good.sim.yml")
    assert here["good"].digest == outcomes["good"].digest


def plain_python(folder: Path) -> Path:
    """A folder with a `python` that is like none but this machine's, whatever PYTHONPATH says."""
    (folder / "bin").mkdir()
    # On Windows, the names of programs end so.
    for name in ("python", "python.exe"):
        program = folder / "bin" / name
        program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -I "$@"\n')
        program.chmod(0o700)
    return folder / "bin"
