"""The command line as people and workflows call it: real processes, real files."""

from __future__ import annotations

import os
import re
import resource
import subprocess
import sys
from functools import partial
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

import junitparser
import pytest

from sim_action.engines import installed
from sim_action.results.output_folder import locked
from sim_action.results.results_json import Results
from tests.integration.conftest import ACTION, interpreter, outcomes, outside_of_github, sim_action
from tests.scenarios import LEAST, driving
from tests.soak import soaked

ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ACTION)}


def changed(before: str, after: str) -> str:
    text = driving("changed")
    assert before in text
    return text.replace(before, after)


BAD = {
    "empty": "",
    "not-yaml": "name: [",
    "duplicate-key": changed("time_limit: 5 s", "time_limit: 5 s\ntime_limit: 4 s"),
    "unknown-key": changed("time_limit", "time_limt"),
    "wrong-type": changed("robot: {model: turtlebot3_burger}", "robot: [1, 2]"),
    "negative-time": changed("5 s", "-5 s"),
    "nan": changed("5 s", ".nan"),
    "wrong-unit": changed("5 s", "5 kg"),
    "unknown-robot": changed("turtlebot3_burger", "turtlebot3_burgr"),
    "no-model-file": changed("turtlebot3_burger", "missing.urdf"),
    "outside": changed("turtlebot3_burger", "../../../../etc/passwd"),
    "no-joint": changed(
        "{model: turtlebot3_burger}", "{model: turtlebot3_burger, drive: {diff: {left: [left], right: [right]}}}"
    ),
    "alias-bomb": "a: &a [x, x, x, x, x, x, x, x, x]\n"
    + "".join(f"{b}: &{b} [*{a}, *{a}, *{a}, *{a}, *{a}, *{a}, *{a}, *{a}, *{a}]\n" for a, b in pairwise("abcdefgh")),
    "brackets": "[" * 20_000,
    "newline-in-name": changed("changed", '"one\\ntwo"'),
    "control-in-name": changed("changed", '"bell \\a"'),
    "command-in-name": changed("changed", "'::error::gotcha'"),
    "cdata-in-name": changed("changed", "'x]]>y'"),
}
VALID_NAMES = ("good-1", "good-2", "gap < 1 m | <b>`bold`</b>")


Ran = tuple[Path, subprocess.CompletedProcess[str]]


@pytest.fixture(scope="module")
def bad_run(tmp_path_factory: pytest.TempPathFactory) -> Ran:
    folder = tmp_path_factory.mktemp("bad")
    for name, text in BAD.items():
        (folder / f"{name}.sim.yml").write_text(text)
    with (folder / "huge.sim.yml").open("wb") as huge:
        huge.truncate(100_000_000)
    for number, name in enumerate(VALID_NAMES, 1):
        (folder / f"good-{number}.sim.yml").write_text(driving(f"'{name}'"))
    (folder / "summary.md").touch()
    github = {"GITHUB_ACTIONS": "true", "GITHUB_STEP_SUMMARY": str(folder / "summary.md")}
    return folder, sim_action(folder, "run", ".", "missing.sim.yml", **github)


def test_bad_input_is_exit_code_2_without_a_traceback_and_the_valid_ones_ran_all_the_same(bad_run: Ran) -> None:
    folder, ran = bad_run
    assert ran.returncode == 2
    assert "Traceback" not in ran.stdout + ran.stderr
    junit = junitparser.JUnitXml.fromfile(str(folder / "sim-results/junit.xml"))
    assert junit.errors >= len(BAD) + 2
    passed = [suite.name for suite in junit for case in suite if not case.result]
    assert sorted(passed) == sorted(VALID_NAMES)
    assert "<b>" not in (folder / "summary.md").read_text()


def test_each_bad_file_has_an_error_with_its_place_in_every_report(bad_run: Ran) -> None:
    folder, ran = bad_run
    by_file = {outcome["file"]: outcome for outcome in outcomes(folder)}
    for name in (*BAD, "huge", "missing"):
        outcome = by_file[f"{name}.sim.yml"]
        assert outcome["status"] == "error", name
        assert all(failure["message"] for failure in outcome["failures"]), name
        assert re.search(rf"{name}\.sim\.yml(:\d+:\d+)?", ran.stdout), name
        assert name in (folder / "sim-results/junit.xml").read_text()
        assert name in (folder / "summary.md").read_text().replace("\\", "")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a scenario that passes."""
    (tmp_path / "a.sim.yml").write_text(driving("a"))
    return tmp_path


def test_validate_prints_the_warnings_of_the_audit(tmp_path: Path) -> None:
    text = driving("a").replace("expect: [", "expect: [no_collision, ")
    (tmp_path / "a.sim.yml").write_text(f"{text}variations: {{robot.pose.x: [0, 1]}}\n")
    checked = sim_action(tmp_path, "validate", "a.sim.yml")
    assert checked.returncode == 0
    (line, count) = checked.stdout.splitlines()
    assert re.fullmatch(r"a\.sim\.yml:\d+:10: warning: the world has no objects, .* \[nothing-to-touch\]", line)
    assert count == "1 valid, 0 invalid (2 runs with all variations)"


def test_validate_says_the_same_with_lines_and_columns(bad_run: Ran) -> None:
    folder, _ = bad_run
    checked = sim_action(folder, "validate", ".")
    assert checked.returncode == 2
    assert checked.stderr == f"{len(VALID_NAMES)} valid, {len(BAD) + 1} invalid\n"
    lines = checked.stdout.splitlines()
    assert all(re.match(r"[\w-]+\.sim\.yml(:\d+:\d+)?: .", line) for line in lines)
    assert "unknown-key.sim.yml:5:1: time_limt: unknown key; did you mean 'time_limit'?" in checked.stdout


def test_no_scenario_is_exit_code_5_and_still_a_junit(tmp_path: Path) -> None:
    ran = sim_action(tmp_path, "run")
    assert ran.returncode == 5
    assert "no scenario found at '.'" in ran.stderr
    assert junitparser.JUnitXml.fromfile(str(tmp_path / "sim-results/junit.xml")).tests == 0


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not remove a current folder")
@pytest.mark.parametrize("arguments", ["run", "validate"])
def test_a_current_folder_that_was_removed_is_exit_code_2(tmp_path: Path, arguments: str) -> None:
    program = f"rmdir . 2>/dev/null || rmdir ../here; exec '{sys.executable}' -m sim_action {arguments}"
    (tmp_path / "here").mkdir()
    ran = subprocess.run(["sh", "-c", program], cwd=tmp_path / "here", capture_output=True, text=True, check=False)
    assert ran.returncode == 2, ran.stderr
    assert ran.stderr.splitlines() == ["sim-action: the current folder does not exist any more"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
def test_a_full_disk_behind_the_log_does_not_change_the_exit_code(folder: Path) -> None:
    command = [sys.executable, "-m", "sim_action", "run"]
    with Path("/dev/full").open("w") as full:
        call = partial(subprocess.run, command, cwd=folder, env=ENVIRONMENT, stdout=full, text=True, check=False)
        ran = call(stderr=subprocess.PIPE)
        assert ran.returncode == 0
        assert "warning: the report for the terminal cannot be written to standard output: no space" in ran.stderr
        assert "Traceback" not in ran.stderr
        assert call(stderr=full).returncode == 0
    assert junitparser.JUnitXml.fromfile(str(folder / "sim-results/junit.xml")).tests == 1


def test_one_run_at_a_time_uses_an_output_folder(folder: Path) -> None:
    """tests/results/test_output_folder.py looks at the files."""
    (folder / "sim-results").mkdir()
    assert sim_action(folder, "run", "--output-dir", "other").returncode == 0
    with locked(folder / "sim-results"):
        for command in (("run",), ("merge", "other/results.json")):
            ran = sim_action(folder, *command)
            assert ran.returncode == 2
            assert f"in use by another run of sim-action (process {os.getpid()}); wait for it" in ran.stderr


LISTS_FILES = """\
from pathlib import Path
from sim_action import Twist
here = Path(__file__).parent
files = [path.relative_to(here).as_posix() for path in here.glob('sim-results/**/*') if path.is_file()]
(here / 'files.txt').write_text(' '.join(sorted(files)))
def control(observation):
    return Twist.planar(1.0)
"""


def test_a_run_begins_without_the_files_of_the_earlier_one(folder: Path) -> None:
    assert sim_action(folder, "run", "--record", "csv", "--junit", "sim-results/mine.xml").returncode == 0
    (folder / "sim-results/traces/mine.npz").touch()
    (folder / "b.sim.yml").write_text(driving("b", "{script: b.py}"))
    (folder / "b.py").write_text(LISTS_FILES)
    assert sim_action(folder, "run", "b.sim.yml", "--junit", "sim-results/mine.xml").returncode == 0
    kept = {"sim-results/.gitignore", "sim-results/.sim-action.lock", "sim-results/results.jsonl"}
    assert set((folder / "files.txt").read_text().split()) == {*kept, "sim-results/traces/mine.npz"}


def test_a_file_name_that_is_no_text_is_written_out(tmp_path: Path) -> None:
    for name in (b"odd-\xff.sim.yml", b"bad-\xff.sim.yml"):
        (tmp_path / os.fsdecode(name)).write_text(driving("odd") if name.startswith(b"odd") else "")
    ran = sim_action(tmp_path, "run", ".")
    assert ran.returncode == 2, ran.stderr
    statuses = {outcome["file"]: outcome["status"] for outcome in outcomes(tmp_path)}
    assert statuses == {"bad-\\xff.sim.yml": "error", "odd-\\xff.sim.yml": "passed"}


def test_a_pattern_that_finds_nothing_is_no_pass(folder: Path) -> None:
    assert sim_action(folder, "run", "a.sim.yml", "./a.sim.yml").returncode == 0
    ran = sim_action(folder, "run", "a.sim.yml", "nope*.sim.yml")
    assert ran.returncode == 2
    assert "1 passed, 1 error" in ran.stdout
    assert "no scenario found at 'nope*.sim.yml'; correct the path" in ran.stdout
    assert sim_action(folder, "validate", "a.sim.yml", "nope*.sim.yml").returncode == 2


def test_files_go_where_they_are_asked_to(tmp_path: Path) -> None:
    (tmp_path / "a b.sim.yml").write_text(driving("with spaces"))
    ran = sim_action(tmp_path, "run", "a b.sim.yml", "--output-dir", "out put", "--junit", "x/y.xml", "--junit-strict")
    assert ran.returncode == 0, ran.stderr
    written = {path.name for path in (tmp_path / "out put").iterdir()}
    assert written == {"results.json", "results.jsonl", "report.html", "replays", "traces", ".gitignore"}
    assert "<testcase" in (tmp_path / "x/y.xml").read_text()


@pytest.mark.parametrize("redirection", soaked([">&-", "2>&-", "<&-", ">&- 2>&- <&-"], short=["2>&-", ">&- 2>&- <&-"]))
def test_closed_streams_change_no_verdict(folder: Path, redirection: str) -> None:
    command = ["bash", "-c", f'"$0" -m sim_action run a.sim.yml {redirection}', sys.executable]
    ran = subprocess.run(command, cwd=folder, env=ENVIRONMENT, capture_output=True, check=False)
    assert ran.returncode == 0
    assert outcomes(folder)[0]["status"] == "passed"


def test_lists_are_printed(tmp_path: Path) -> None:
    has = {"models": "turtlebot3_burger", "assertions": "at_least", "commands": "rate", "sensors": "contact"}
    for command, word in {**has, "schema": "Quantity_"}.items():
        ran = sim_action(tmp_path, command)
        assert (ran.returncode, word in ran.stdout) == (0, True), command


ENGINES = {"pybullet", "numpy"}
OF_RUNS = {"sim_action.simulation.loop", "sim_action.state.trace_storage", "sim_action.world.distance_lines"}
UNUSED = {"numpy.ma", "statistics", "rich", "sim_action.recording.replay", "sim_action.reports.html"}
# The package of MuJoCo imports some.
OF_MAIL = {"email", "importlib.metadata", "socket"} if "pybullet" in installed() else set()


@pytest.mark.parametrize(
    ("arguments", "unneeded"),
    [
        (("--help",), ENGINES),
        (("validate", "a.sim.yml"), ENGINES | OF_RUNS),
        (("run", "a.sim.yml", "--no-report"), UNUSED | OF_MAIL),
    ],
)
def test_only_what_is_needed_is_imported(arguments: tuple[str, ...], unneeded: set[str], folder: Path) -> None:
    """tests/tools/test_budgets.py counts our modules."""
    assert all(find_spec(name) for name in unneeded if name.startswith("sim_action.")), "a module was renamed"
    code = "import sys\nfrom sim_action.cli.main import call\ncall(sys.argv[1:])\nprint(*sys.modules)"
    ran = interpreter(folder, "-c", code, *arguments, env=outside_of_github({}))
    assert not set(ran.stdout.splitlines()[-1].split()) & unneeded


on_linux = pytest.mark.skipif(sys.platform != "linux", reason="limits of Linux")


def doctor(**variables: str) -> tuple[int, dict[str, tuple[str, str]]]:
    """The exit code, and name -> mark and text, below half of the address space that a scenario may use."""
    ran = subprocess.run(
        [sys.executable, "-m", "sim_action", "doctor"],
        env=outside_of_github(variables),
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (2 << 30, 2 << 30)),
    )
    assert ran.stderr == ""
    lines = ran.stdout.splitlines()
    return ran.returncode, {line[3:19].strip(): (line[:3].strip(), line[20:]) for line in lines}


@on_linux
def test_engines_drive_a_robot_and_limits_and_folders_are_told(tmp_path: Path) -> None:
    code, told = doctor(TMPDIR=str(tmp_path), XDG_CACHE_HOME=str(tmp_path / "cache"))
    assert code == 0
    for engine in installed():
        mark, text = told[engine]
        assert (mark, text.rpartition(": ")[2]) == ("ok", "a robot drove")
    assert {"sim-action", "mcap", "parallel runs", "temporary files", "cache", "ROS 1", "ROS 2"} <= set(told)
    # Scenarios run all the same.
    assert told["memory"][0] == "-"
    assert told["memory"][1].startswith("2 GiB of address space, and a scenario may use 4")
    assert told["temporary files"][1].startswith(f"{tmp_path}, ")
    assert told["cache"] == ("ok", f"0 MB of hulls of meshes in {tmp_path / 'cache/sim-action'}")


@on_linux
def test_a_missing_engine_and_a_missing_extra_say_how_to_get_them(tmp_path: Path) -> None:
    for name in ("mujoco", "mcap"):
        (tmp_path / name).mkdir()
    # An import that finds nothing there: as if neither was installed.
    (tmp_path / "sitecustomize.py").write_text(
        "import importlib.util as util\n"
        "find = util.find_spec\n"
        "util.find_spec = lambda name, package=None: None if name in ('mujoco', 'mcap') else find(name, package)\n"
    )
    _, told = doctor(PYTHONPATH=f"{tmp_path}:{ACTION}")
    assert told["mujoco"] == ("-", "not installed; pip install mujoco-core")
    assert told["mcap"][1].startswith("not installed; pip install 'sim-action[mcap]' adds recordings")


# An assertion whose check is at fault, in the table as a contributor would put it there.
FAULTY = """
import sys
from typing import ClassVar

from sim_action.assertions import ASSERTIONS
from sim_action.assertions.upright import Upright
from sim_action.cli.main import call


class Faulty(Upright):
    key: ClassVar[str] = "faulty"

    def problems(self, scene):
        yield {}["nowhere"]


if __name__ == "__main__":
    ASSERTIONS.paths["faulty"] = "faulty:Faulty"
    sys.exit(call(sys.argv[1:]))
"""
SAID = "an internal error of sim-action: KeyError: 'nowhere'; please report it"


@pytest.fixture
def with_a_fault(tmp_path: Path) -> Path:
    (tmp_path / "faulty.py").write_text(FAULTY)
    for name, expected in (("a", "upright"), ("b", "faulty"), ("c", "upright: {max_tilt: 1 m}")):
        text = LEAST.replace("travel: {at_least: 1.5 m}", expected).replace("30 s", "0.1 s")
        (tmp_path / f"{name}.sim.yml").write_text(text)
    return tmp_path


def called(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return interpreter(folder, "faulty.py", *arguments, env={"PYTHONPATH": str(ACTION)})


def test_a_fault_of_sim_action_in_a_check_is_an_error_of_that_scenario_and_the_others_run(with_a_fault: Path) -> None:
    assert called(with_a_fault, "run").returncode == 3
    results = Results.read(with_a_fault / "sim-results/results.json")
    passed, faulty, invalid = results.outcomes
    assert [outcome.status for outcome in results.outcomes] == ["passed", "error", "error"]
    assert (passed.exit_code, faulty.exit_code, invalid.exit_code) == (0, 3, 2)
    (failure,) = faulty.failures
    assert (faulty.name, faulty.file) == ("burger drives straight", "b.sim.yml")
    assert (failure.kind, failure.title, failure.message) == ("internal", "internal error", SAID)
    assert failure.details.startswith("Traceback (most recent call last):\n")
    assert "in problems\n" in failure.details


def test_validate_reports_such_a_fault_beside_what_is_invalid(with_a_fault: Path) -> None:
    validated = called(with_a_fault, "validate")
    assert validated.returncode == 3
    assert f"b.sim.yml: {SAID}\nTraceback (most recent call last):\n" in validated.stdout
    assert "c.sim.yml:9:15: expect.0.upright.max_tilt: " in validated.stdout
    assert "1 valid, 1 invalid, 1 not checked to the end" in validated.stderr
