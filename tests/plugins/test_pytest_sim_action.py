"""The plugin of pytest, on two major versions of pytest."""

from __future__ import annotations

import importlib.metadata
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final

import pytest

from sim_action.engines import installed
from tests.integration.conftest import locked
from tests.integration.warm import WARM
from tests.soak import soaked

pytest_plugins = ["pytester"]
pytestmark = pytest.mark.process
ROOT = Path(__file__).parents[2]
PLUGIN = ROOT / "plugins/pytest-sim-action"
FORMER = "pytest>=8,<9"  # the major version that the project's own tests do not use
Run = Callable[..., pytest.RunResult]

DRIVES = """\
name: burger drives
tags: [smoke, fast-run]
robot: {model: turtlebot3_burger}
commands: {rate: 10 Hz, twist: [{linear: 1.0}]}
expect: [{travel: {at_least: 5 cm}}]
time_limit: 0.5 s
"""
STUCK = DRIVES.replace("burger drives", "stuck").replace("1.0", "0.0").replace("smoke, fast-run", "slow")


@pytest.fixture(scope="session")
def former(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with another major version of pytest alone, installed once for all workers."""
    shared = tmp_path_factory.getbasetemp()
    shared = shared.parent if "PYTEST_XDIST_WORKER" in os.environ else shared
    folder = shared / "former pytest"
    with locked(shared / "former-pytest-lock"):
        if not (folder / "pytest").exists():
            command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", str(folder), FORMER]
            subprocess.run(command, check=True)
    return folder


VERSIONS: Final = ("of the project", "former")

with_both = pytest.mark.parametrize("run", VERSIONS, indirect=True)
"""With both versions of pytest, also without `--soak`."""


@pytest.fixture(params=soaked(VERSIONS, short=VERSIONS[:1]))
def run(request: pytest.FixtureRequest, pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run pytest with the plugin in the folder of the test."""
    path = [str(PLUGIN), str(ROOT)]
    if request.param == "former":
        path.insert(0, str(request.getfixturevalue("former")))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(path))
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")

    def call(*arguments: str) -> pytest.RunResult:
        words = ("-p", "pytest_sim_action", "-p", "no:cacheprovider", *arguments)
        if request.param == "former":
            result = pytester.run(sys.executable, "-m", "pytest", *words)
        else:
            code, out, errors = WARM.call(pytester.path, words, dict(os.environ), program="pytest")
            result = pytest.RunResult(code, out.splitlines(), errors.splitlines(), duration=0.0)
        version = importlib.metadata.version("pytest").partition(".")[0]
        other = "pytest-8." if request.param == "former" else f"pytest-{version}."
        assert "-q" in arguments or other in result.stdout.str()
        return result

    return call


def write(pytester: pytest.Pytester, **files: str) -> None:
    for name, text in files.items():
        (pytester.path / f"{name}.sim.yml").write_text(text)


@with_both
def test_scenarios_are_tests_and_failures_have_the_report(pytester: pytest.Pytester, run: Run) -> None:
    write(pytester, a=DRIVES, b=STUCK)
    result = run()
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(
        [
            "b.sim.yml F*",
            "*_ stuck _*",
            "✗ stuck  b.sim.yml  *",
            "  ✗ travel at least 0.05 m: travelled *",
            "      b.sim.yml:5:11",
            "FAILED b.sim.yml::stuck - travelled * of 0.05 m*",
        ]
    )
    result.stdout.no_fnmatch_line("*Traceback*")
    result.stdout.no_fnmatch_line("*runtest*")


def test_variations_names_and_tags_select(pytester: pytest.Pytester, run: Run) -> None:
    write(pytester, a=f"{DRIVES}variations: {{robot.pose.yaw: [0, 1]}}\n", b=STUCK)
    (pytester.path / "test_other.py").write_text("def test_other(): pass\n")
    listed = run("--collect-only", "-q", "--strict-markers", "-m", "smoke or fast-run")
    assert listed.stdout.lines[:2] == ["a.sim.yml::burger drives[yaw=0]", "a.sim.yml::burger drives[yaw=1]"]
    run("-k", "other or stuck").assert_outcomes(passed=1, failed=1, deselected=2)
    run("a.sim.yml::burger drives[yaw=0]").assert_outcomes(passed=1)


ACTING = ("skip", "skipif", "xfail", "usefixtures", "parametrize", "filterwarnings", "timeout", "flaky", "order")
"""Marks on which pytest, or a plugin that is often installed, acts."""


def test_tags_select_and_do_nothing_else(pytester: pytest.Pytester, run: Run) -> None:
    tagged = {f"a_{tag}": STUCK.replace("[slow]", f"[{tag}]").replace("stuck", f"is {tag}") for tag in ACTING}
    write(pytester, **tagged)
    (pytester.path / "conftest.py").write_text(
        "def pytest_runtest_setup(item):\n"
        f"    for name in {ACTING}:\n"
        "        assert item.get_closest_marker(name) is None\n"
        "        assert list(item.iter_markers(name)) == []\n"
        "        assert (name in item.keywords) == (item.name == f'is {name}')\n"
    )
    run("--strict-markers").assert_outcomes(failed=len(ACTING))
    listed = run("--collect-only", "-q", "-m", "xfail or timeout").stdout.lines
    assert [line.rpartition(" ")[2] for line in listed[:3]] == ["timeout", "xfail", ""]


@pytest.mark.soak
def test_marks_of_the_user_act(pytester: pytest.Pytester, run: Run) -> None:
    write(pytester, a=DRIVES, b=STUCK)
    (pytester.path / "conftest.py").write_text(
        "import pytest\n\n\ndef pytest_collection_modifyitems(items):\n    items[1].add_marker(pytest.mark.xfail)\n"
    )
    run().assert_outcomes(passed=1, xfailed=1)


RAISED = """
def pytest_exception_interact(node, call, report):
    print()
    print("of", node.name, "raised", call.excinfo.type.__name__)
"""
AGAIN = """
def pytest_runtest_teardown(item):
    item.runtest()
"""


def test_failed_expectations_are_assertion_errors_and_other_ends_not(pytester: pytest.Pytester, run: Run) -> None:
    """Other plugins tell a test that failed from one that is broken by it."""
    crash = DRIVES.replace("twist: [{linear: 1.0}]", "script: it.py").replace("burger drives", "crash")
    write(pytester, a=DRIVES, b=STUCK, c=crash, d=GATE.replace("at_least: 50 %", "at_least: 80 %"))
    (pytester.path / "it.py").write_text("def control(observation):\n    raise ValueError\n")
    (pytester.path / "conftest.py").write_text(RAISED)
    result = run("-s", "--deselect", "d.sim.yml::slip[yaw=1]")
    raised = re.findall(r"^of (\S+) raised (\w+)", result.stdout.str(), re.MULTILINE)
    assert set(raised) == {("stuck", "AssertionError"), ("crash", "ScenarioError"), ("slip[yaw=0]", "AssertionError")}


@pytest.mark.soak
def test_an_item_that_runs_again_has_its_properties_once(pytester: pytest.Pytester, run: Run) -> None:
    write(pytester, a=DRIVES)
    (pytester.path / "conftest.py").write_text(AGAIN)
    run("--junitxml", "j.xml").assert_outcomes(passed=1)
    assert (pytester.path / "j.xml").read_text().count("digest of") == 1


IGNORED = """
import pytest

WAYS = {
    "nothing": lambda results: None,
    "its motion": lambda results: results[0].trace,
    "its digest": lambda results: [each.digest for each in results],
    "passed": lambda results: results.passed,
    "itself": lambda results: not results,
    "the outcome": lambda results: not results[0],
    "status": lambda results: results[0].status == "failed",
    "failures": lambda results: results[0].failures,
    "exit code": lambda results: results.exit_code,
}


@pytest.mark.parametrize(("name", "way"), [("a", "nothing"), *(("b", way) for way in WAYS)])
def test_it(sim_run, name, way):
    WAYS[way](sim_run(f"{name}.sim.yml"))


def test_one_of_two(sim_run):
    assert not sim_run("b.sim.yml")
    sim_run("b.sim.yml")


@pytest.mark.parametrize("way", ["results", "outcome", "status"])
def test_that_asserts(sim_run, way):
    results = sim_run("b.sim.yml")
    if way == "status":
        assert results[0].status == "passed"
    assert results.passed if way == "results" else results[0]


def test_that_fails_by_itself(sim_run):
    sim_run("b.sim.yml")
    raise ValueError


@pytest.fixture
def ran(sim_run):
    return sim_run("b.sim.yml")


def test_of_a_fixture(ran):
    pass
"""


def test_a_failure_that_a_test_ignores_fails_it(pytester: pytest.Pytester, run: Run) -> None:
    write(pytester, a=DRIVES, b=STUCK)
    (pytester.path / "test_it.py").write_text(IGNORED)
    result = run("-rf", "test_it.py")
    failed = re.findall(r"^FAILED \S+?::(.+?) - (.*)$", result.stdout.str(), re.MULTILINE)
    assert [name for name, _ in failed] == [
        "test_it[b-nothing]",
        "test_it[b-its motion]",
        "test_it[b-its digest]",
        "test_one_of_two",
        *(f"test_that_asserts[{way}]" for way in ("results", "outcome", "status")),
        "test_that_fails_by_itself",
        "test_of_a_fixture",
    ]
    assert failed[0][1].startswith("Failed: 'stuck' did not pass")
    assert all(cause.startswith("travelled ") for _, cause in failed[4:7])
    assert failed[7][1].startswith("ValueError")
    result.stdout.fnmatch_lines(["*Captured sim-action call*", "✗ stuck  b.sim.yml*"])


def test_a_file_that_is_invalid_is_an_error_with_its_problems(pytester: pytest.Pytester, run: Run) -> None:
    write(pytester, a=DRIVES, bad=DRIVES.replace("time_limit", "time_limt"))
    result = run("--continue-on-collection-errors")
    result.assert_outcomes(passed=1, errors=1)
    result.stdout.fnmatch_lines(["bad.sim.yml:6:1: time_limt: unknown key; did you mean 'time_limit'?*"])
    result.stdout.no_fnmatch_line("*Traceback*")


FIXTURE = """
import pytest
import sim_action


@pytest.mark.parametrize("speed", [1.0, 0.0])
def test_speed(sim_run, speed):
    results = sim_run("../a.sim.yml", seed=3, **{"commands.twist.0.linear": speed})
    assert results[0].record.seed == 3
    assert results.passed


def test_a_scenario_of_its_own(sim_run):
    scenario = sim_action.Scenario(
        name="mine",
        robot={"model": "turtlebot3_burger"},
        commands={"twist": [{"linear": 1.0}]},
        expect=[{"travel": {"at_least": 0.05}}],
        time_limit=0.5,
    )
    first, second = sim_run(scenario), sim_run(scenario)
    assert first[0].digest == second[0].digest
"""


def test_the_fixture_runs_and_changes_scenarios(pytester: pytest.Pytester, run: Run) -> None:
    write(pytester, a=DRIVES)
    (pytester.path / "tests").mkdir()
    (pytester.path / "tests/test_it.py").write_text(FIXTURE)
    result = run("tests", "--sim-output", "out")
    result.assert_outcomes(passed=2, failed=1)
    result.stdout.fnmatch_lines(["*Captured sim-action call*", "✗ burger drives  a.sim.yml*", "*travelled*"])
    folders = sorted(path.parent.name for path in pytester.path.glob("out/*/report.html"))
    assert [re.sub("-[0-9a-f]{8}-", " ", name) for name in folders] == [
        "tests-test_it.py-test_a_scenario_of_its_own 1",
        "tests-test_it.py-test_a_scenario_of_its_own 2",
        "tests-test_it.py-test_speed-0.0 1",
        "tests-test_it.py-test_speed-1.0 1",
    ]


@pytest.mark.soak
def test_each_test_has_a_folder_of_its_own(pytester: pytest.Pytester, run: Run) -> None:
    names = ["a b", "a-b", "前進", "後退", "前" * 120]
    lines = "".join(f"  - name: {name}\n" for name in names)
    write(pytester, a=f"scenarios:\n{lines}" + DRIVES.partition("\n")[2])
    run("--sim-output", "out").assert_outcomes(passed=5)
    found = [path.parent for path in pytester.path.glob("out/*/results.json")]
    assert len(found) == 5
    run("--sim-output", "out", "-k", "a-b").assert_outcomes(passed=1, deselected=4)
    assert {path.parent for path in pytester.path.glob("out/*/results.json")} == {*found}


@pytest.mark.soak
def test_a_run_that_has_no_digest_has_no_property(pytester: pytest.Pytester, run: Run) -> None:
    write(pytester, a=DRIVES.replace("twist: [{linear: 1.0}]", "script: it.py"))
    (pytester.path / "it.py").write_text("def control(observation):\n    raise ValueError\n")
    run("--junitxml", "j.xml").assert_outcomes(failed=1)
    assert "digest" not in (pytester.path / "j.xml").read_text()


def test_a_wrong_call_of_the_fixture_shows_the_line_of_the_test(pytester: pytest.Pytester, run: Run) -> None:
    pytester.makepyfile("def test_it(sim_run):\n    sim_run('nowhere.sim.yml')\n")
    result = run()
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines([">*sim_run('nowhere.sim.yml')", "E *there is no file or folder 'nowhere.sim.yml'*"])
    result.stdout.no_fnmatch_line("*sim_action/*.py:*")


@pytest.mark.soak
def test_engines_and_workers_are_chosen(pytester: pytest.Pytester, run: Run) -> None:
    if "mujoco" not in installed():
        pytest.skip("MuJoCo is not installed")
    write(pytester, a=DRIVES, b=STUCK)
    result = run("-p", "xdist", "-n", "2", "--sim-backend", "mujoco")
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(["✗ stuck  b.sim.yml  mujoco *"])


def test_what_checks_nothing_is_a_warning(pytester: pytest.Pytester, run: Run) -> None:
    write(pytester, a=DRIVES.replace("5 cm}}]", "5 cm}}, no_collision]"))
    result = run()
    result.assert_outcomes(passed=1, warnings=1)
    result.stdout.fnmatch_lines(["*SimActionWarning: a.sim.yml:5:*nothing-to-touch*"])
    strict = run("--sim-strict")
    strict.assert_outcomes(failed=1, warnings=1)
    strict.stdout.fnmatch_lines(["*✗*nothing-to-touch*"])


GATE = """\
name: slip
tags: [smoke]
robot: {model: turtlebot3_burger}
commands: {rate: 10 Hz, twist: [{linear: 0.2}]}
expect: [{travel: {at_least: 10 cm}}]
time_limit: 1 s
variations:
  robot.pose.yaw: [0, 1]
  world.ground.friction: {uniform: [0.001, 0.5]}
gate: {passes: {at_least: 50 %, confidence: 75 %}, runs: 7}
"""


def test_a_gate_is_one_test(pytester: pytest.Pytester, run: Run) -> None:
    write(pytester, a=GATE, b=DRIVES)
    listed = run("--collect-only", "-q", "-m", "smoke")
    assert listed.stdout.lines[:3] == ["a.sim.yml::slip[yaw=0]", "a.sim.yml::slip[yaw=1]", "b.sim.yml::burger drives"]
    run("-k", "slip", "--junitxml", "j.xml").assert_outcomes(passed=2, deselected=1)
    assert re.search('name="passed runs of slip.yaw=1." value="6 of 7"', (pytester.path / "j.xml").read_text())


def test_a_gate_that_does_not_pass_shows_its_worst_runs(pytester: pytest.Pytester, run: Run) -> None:
    write(pytester, a=GATE.replace("at_least: 50 %", "at_least: 80 %"))
    result = run("-p", "xdist", "-n", "2", "a.sim.yml::slip[yaw=0]")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        [
            "*6 of 7 runs passed*too few runs to tell*",
            "*friction=0.0*failed (travelled *",
            "FAILED *slip* - *6 of 7 runs passed*",
        ]
    )
