"""`sim_action.run`, `load` and `validate` as programs call them, and gates."""

from __future__ import annotations

import copy
import os
import pickle
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import sim_action
from sim_action import GateOutcome, Results, Scenario, load, run, validate
from sim_action.errors import InvalidScenario, MissingScenario, SimActionError, UsageError
from sim_action.parts import Travel, Upright
from sim_action.results.journal import Finished, Started
from tests.integration.conftest import ACTION, interpreter, outcomes
from tests.integration.conftest import sim_action as command_line

FILE = """\
name: {name}
tags: [{tag}]
robot: {{model: turtlebot3_burger}}
commands: {{rate: 10 Hz, twist: [{{linear: {speed}}}]}}
expect: [{{travel: {{at_least: 5 cm}}}}, upright]
time_limit: 0.5 s
"""


def burger(**keys: Any) -> Scenario:
    return Scenario(
        **{
            "name": "burger drives",
            "robot": {"model": "turtlebot3_burger"},
            "commands": {"rate": 10, "twist": [{"linear": 1.0}]},
            "expect": [Travel(at_least=0.05), Upright()],
            "time_limit": 0.5,
            **keys,
        }
    )


def wrong(**arguments: Any) -> dict[str, Any]:
    """Return arguments of other types than the signature has."""
    return arguments


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "a.sim.yml").write_text(FILE.format(name="a", tag="fast", speed=1))
    (tmp_path / "b.sim.yml").write_text(FILE.format(name="b", tag="slow", speed=0))
    return tmp_path


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """The results of one run that passes and one that fails."""
    folder = tmp_path_factory.mktemp("both")
    for name, speed in (("a", 1), ("b", 0)):
        (folder / f"{name}.sim.yml").write_text(FILE.format(name=name, tag=name, speed=speed))
    return run(folder, report=False)


@pytest.fixture
def passed(tmp_path: Path) -> Results:
    """The results of one run, in a folder of its own."""
    return run(burger(), output_dir=tmp_path / "out")


def test_results_are_those_of_the_command_line(folder: Path) -> None:
    results = run(folder)
    assert command_line(folder, "run", "--quiet").returncode == results.exit_code == 1
    theirs = [(outcome["name"], outcome["status"], outcome["digest"]) for outcome in outcomes(folder)]
    assert [(outcome.name, outcome.status, outcome.digest) for outcome in results] == theirs
    assert [each.status for each in results] == ["passed", "failed"]
    assert (results.passed, len(results), results["b"].passed) == (False, 2, False)
    (reason,) = results["b"].record.reasons
    assert repr(results) == f"Results(1 passed, 1 failed; 'b': {reason})"
    assert repr(results["b"]) == f"Outcome(name='b', status='failed', {reason!r})"


def test_a_table_has_a_row_for_each_expectation(both: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(UsageError, match="pip install pandas"):
        both.to_dataframe()
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=list))
    rows = cast("list[dict[str, Any]]", both.to_dataframe())[::2]  # the other expectation is `upright`
    columns = [(row["scenario"], row["verdict"], row["unit"]) for row in rows]
    assert columns == [("a", "passed", "m"), ("b", "failed", "m")]
    assert rows[1]["margin"] == rows[1]["measured"] - rows[1]["limit"] < 0


def test_results_are_true_if_they_passed(both: Results) -> None:
    """So `assert run(...)` is a check, and `failures` names each reason not to pass."""
    results = copy.deepcopy(both)
    assert not results
    assert [bool(outcome) for outcome in results] == [True, False]
    assert results[0].failures == results["b"].errors == ()
    (reason,) = results["b"].failures
    assert reason.message.startswith("travelled ")
    assert str(reason.location).endswith("b.sim.yml:5:11")


def test_reasons_without_a_verdict_are_failures_and_errors(tmp_path: Path) -> None:
    (tmp_path / "it.py").write_text("def control(observation):\n    raise ValueError('no')\n")
    results = run(burger(commands={"script": str(tmp_path / "it.py")}), report=False, allow_outside=True)
    assert not results[0]
    assert results[0].failures == results[0].errors
    assert "no" in results[0].errors[0].message


def test_a_failure_is_ignored_until_its_verdict_is_read(folder: Path) -> None:
    results = run(folder, report=False)
    assert str(results)
    assert results[1].name == "b"
    assert results[1].trace.time.size
    for look in ("passed", "status", "expectations", "failures", "errors", "__bool__"):
        outcome = copy.copy(results[1])
        assert outcome.is_ignored_failure
        value = getattr(outcome, look)
        assert not (callable(value) and value())
        assert not outcome.is_ignored_failure, look
    assert [each.is_ignored_failure for each in results] == [False, True]
    assert not results
    assert not results[1].is_ignored_failure


def test_a_scenario_of_a_program_runs_like_its_text(tmp_path: Path) -> None:
    scenario = burger()
    (tmp_path / "same.sim.yml").write_text(scenario.to_yaml())
    mine, same = run([scenario, tmp_path / "same.sim.yml"], output_dir=tmp_path / "out")
    assert mine
    assert mine.digest == same.digest
    assert mine.trace.time[-1] == mine.sim_time
    assert mine.trace.base_position_xyz[-1, 0] > 0.05
    assert (tmp_path / "out/junit.xml").exists()


def test_a_temporary_folder_lasts_as_long_as_an_outcome(tmp_path: Path) -> None:
    results = run(burger())
    place, outcome = results.folder, results[0]
    assert results.to_junit(tmp_path / "j.xml").read_bytes().startswith(b"<?xml")
    assert b"<html" in results.to_html(tmp_path / "r.html").read_bytes()
    del results
    assert len(outcome.trace.time) > 1
    del outcome
    assert not place.exists()


def test_copies_of_results_have_their_files() -> None:
    results = run(burger())
    place = results.folder
    copied, also = copy.deepcopy(results), pickle.loads(pickle.dumps(results))
    del results
    assert len(copied[0].trace.time) == len(also[0].trace.time) > 1
    del also
    assert not place.exists()


def test_numbers_of_numpy_are_whole_numbers() -> None:
    results = run(burger(), **wrong(seed=np.int64(3), jobs=np.int8(1)), report=False)
    assert results
    assert results[0].record.seed == 3


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not remove a current folder")
def test_a_current_folder_that_was_removed_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "gone").mkdir()
    scenario = burger(folder=tmp_path)
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    for call in (lambda: run(scenario), lambda: load(tmp_path), burger):
        with pytest.raises(SimActionError, match="the current folder does not exist any more"):
            call()


def printed_by(folder: Path, *arguments: str) -> str:
    """What an interpreter prints, which ends well and writes no error."""
    ran = interpreter(folder, *arguments, env=os.environ)
    assert (ran.returncode, ran.stderr) == (0, "")
    return ran.stdout


@pytest.mark.skipif(sys.platform != "linux", reason="other systems start no process for a call")
def test_a_system_without_open_files_or_temporary_folder_is_reported(tmp_path: Path) -> None:
    program = """
import os, resource, tempfile
from tests.integration.test_library import burger
import sim_action
from sim_action.errors import InternalError, UsageError
sim_action.run(burger(), report=False)
from sim_action.runner import warm_process
warm_process._POOL.close()
resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64))
opened = []
try:
    while True:
        opened.append(os.open(os.devnull, os.O_RDONLY))
except OSError:
    pass
try:
    sim_action.run(burger(), report=False)
except InternalError as error:
    print(error)
for each in opened:
    os.close(each)
tempfile.tempdir = "/nowhere"
try:
    sim_action.run(burger(), report=False)
except UsageError as error:
    print(error)
"""
    assert printed_by(ACTION, "-c", program).splitlines() == [
        "the system refused a request: too many open files",
        "there can be no temporary folder: no such file or directory; set TMPDIR, or give an output folder",
    ]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no fork")
def test_a_fork_that_ends_leaves_the_folder() -> None:
    program = """
import os, sys
from tests.integration.test_library import burger
import sim_action
results = sim_action.run(burger())
if (pid := os.fork()) == 0:
    sys.exit()
os.waitpid(pid, 0)
assert len(results[0].trace.time) > 1
"""
    assert printed_by(ACTION, "-c", program) == ""


def test_files_that_have_gone_are_reported(passed: Results, tmp_path: Path) -> None:
    shutil.rmtree(passed.folder)
    for use in (lambda: passed[0].trace, lambda: passed.to_junit(tmp_path / "j"), lambda: passed.to_html(tmp_path)):
        with pytest.raises(UsageError, match="the folder of these results does not exist any more: "):
            use()


def test_outcomes_are_found_by_name_index_and_slice(both: Results) -> None:
    chosen = (both["a"], both[-1], *both[:1], *both[np.int64(1) :])
    assert [outcome.name for outcome in chosen] == [*"abab"]
    with pytest.raises(KeyError, match="c"):
        both["c"]
    with pytest.raises(IndexError):
        both[2]


def test_notebooks_show_verdicts_and_the_report(tmp_path: Path) -> None:
    results = run(burger(name="<b>"), output_dir=tmp_path)
    page = results._repr_html_()
    assert "&lt;b&gt;" in page
    assert "<iframe" in page
    assert "srcdoc=" in page
    assert "travelled" in results[0]._repr_html_()
    assert 'title="sim-action replay"' in results[0]._repr_html_()
    (tmp_path / "report.html").unlink()
    assert "<iframe" not in results._repr_html_()


def test_without_a_report_there_is_none(both: Results, tmp_path: Path) -> None:
    assert not (both.folder / "report.html").exists()
    with pytest.raises(UsageError, match="report=False"):
        both.to_html(tmp_path / "r.html")


def test_a_run_that_is_invalid_says_why_and_nothing_runs(folder: Path) -> None:
    events: list[object] = []
    bad = burger(robott=1).changed({"time_limit": "3 m"})
    with pytest.raises(InvalidScenario) as error:
        run([folder, bad], on_event=events.append, output_dir=folder / "out")
    assert len(error.value.problems) == 2
    assert "burger drives (Python):1" in str(error.value)
    assert events == []
    assert not (folder / "out").exists()
    with pytest.raises(InvalidScenario, match="did you mean 'robot'"):
        validate(bad)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: run("nowhere.sim.yml"), MissingScenario, "there is no file or folder 'nowhere.sim.yml'"),
        (lambda: run("nowhere/*.yml"), UsageError, r"no scenario found at 'nowhere/\*\.yml'"),
        (lambda: run([]), UsageError, "there is no scenario"),
        (lambda: run(burger(), only="other"), UsageError, "^only: no scenario is named 'other'"),
        (lambda: run(burger(), jobs=0), UsageError, "jobs: "),
        (lambda: run(burger(), repeat=0), UsageError, "repeat: "),
        (lambda: run(burger(), **wrong(jobs="2")), UsageError, "jobs: expected a whole number, found '2'"),
        (lambda: run(burger(), **wrong(seed=1.5)), UsageError, "seed: expected a whole number, found 1.5"),
        (lambda: load(**wrong(seed="a")), UsageError, "seed: expected a whole number, found 'a'"),
        (lambda: run(burger(), **wrong(repeat=True)), UsageError, "repeat: expected a whole number, found True"),
        (lambda: run(burger(), **wrong(backend="ode")), UsageError, "backend: expected .*, found 'ode'"),
        (lambda: run(burger(), **wrong(unexercised="wrn")), UsageError, "expected None or 'error' or 'warn', "),
        (lambda: run(burger(), **wrong(allow_scripts=False)), UsageError, "allow_scripts: .*, found False"),
        (lambda: run("a.sim.yml::3-1"), UsageError, "from the lower to the higher number, found '3-1'"),
        (lambda: run("a\0.sim.yml"), UsageError, "a path has no null character"),
        (lambda: validate(["a\0b"]), UsageError, "a path has no null character"),
        (lambda: run(burger(), record="avi"), UsageError, "unknown format 'avi'"),
        (lambda: run(burger(), packages={"arm": "nowhere"}), UsageError, "there is no such folder"),
        (lambda: load("nowhere.sim.yml"), MissingScenario, "there is no file"),
        (lambda: validate("nowhere.sim.yml"), InvalidScenario, "there is no file"),
    ],
)
def test_errors_have_the_messages_of_the_command_line(
    call: Any, error: type[SimActionError], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(error, match=message):
        call()


def test_scenarios_are_selected_changed_and_run(folder: Path) -> None:
    assert [each.name for each in load(folder)] == ["a", "b"]
    (slow,) = load(folder, tags="slow")
    assert (slow.tags, slow.line, slow.path) == (("slow",), None, folder / "b.sim.yml")
    results = run(slow.changed({"commands.twist.0.linear": "1 m/s", "name": "faster"}))
    assert results.passed
    assert (results[0].name, str(results[0].location)) == ("faster", str(folder / "b.sim.yml"))


def test_variations_run_and_say_their_values() -> None:
    speed = "commands.twist.0.linear"
    results = run(burger(variations={speed: [0.0, 1.0]}))
    assert [(outcome.variation, outcome.passed) for outcome in results] == [({speed: 0.0}, False), ({speed: 1.0}, True)]


def test_events_come_in_order() -> None:
    events: list[object] = []
    run([burger(), burger(name="second")], jobs=1, on_event=events.append)
    places = [(type(event), event.place) for event in events if isinstance(event, Started | Finished)]
    assert places == [(Started, 0), (Finished, 0), (Started, 1), (Finished, 1)]


def test_code_of_the_repository_is_refused_on_demand(tmp_path: Path) -> None:
    (tmp_path / "c.py").write_text("def control(observation):\n    print('hello')\n")
    scenario = burger(commands={"script": "c.py"}, expect=[Upright()], folder=tmp_path)
    with pytest.raises(InvalidScenario, match="allow-scripts is false"):
        run(scenario, allow_scripts="false")
    assert "hello" in run(scenario, allow_scripts="true")[0].output


def test_the_package_lists_its_names_and_imports_none_of_them() -> None:
    assert {"run", "load", "validate", "Results", "Outcome", "Scenario", "errors", "parts"} <= set(dir(sim_action))
    for name in sim_action.__all__:
        assert getattr(sim_action, name)
    code = "import sys, sim_action; print(sorted(name for name in sys.modules if name.startswith('sim_action')))"
    assert printed_by(ACTION, "-c", code) == "['sim_action']\n"


def test_a_program_without_a_guard_runs_scenarios_and_prints_nothing_but_its_own(folder: Path) -> None:
    # Other libraries start a process that runs the program again.
    (folder / "program.py").write_text("import sim_action\nprint(sim_action.run('.').passed)\n")
    assert printed_by(folder, "program.py") == "False\n"


RUNS = 7


def slips() -> Scenario:
    """A robot that gets no grip on some floors."""
    passes = {"at_least": "50 %", "confidence": "75 %"}
    return burger(
        name="slip",
        commands={"rate": 10, "twist": [{"linear": 0.2}]},
        expect=[Travel(at_least=0.1)],
        time_limit=1,
        variations={"world.ground.friction": {"uniform": [0.001, 0.5]}},
        gate={"passes": passes, "runs": RUNS},
    )


@pytest.fixture(scope="module")
def with_gate() -> Results:
    return run([slips(), burger(name="alone", variations={"world.ground.friction": [0.5]})])


@pytest.fixture(scope="module")
def gate(with_gate: Results) -> GateOutcome:
    (gate,) = with_gate.gates
    return gate


def test_a_gate_is_one_outcome_without_a_trace(with_gate: Results, gate: GateOutcome) -> None:
    assert [outcome.name for outcome in with_gate] == ["slip", "alone[friction=0.5]"]
    assert len(with_gate) == 2
    with pytest.raises(UsageError, match=r"'slip' is a gate, and has no trace; use that of a run"):
        _ = gate.trace
    assert with_gate.passed
    assert with_gate[0] is with_gate["slip"] is gate
    assert len(with_gate.runs) == RUNS + 1
    assert repr(with_gate) == "Results(2 passed)"


def test_a_gate_has_its_runs_and_what_they_show(gate: GateOutcome) -> None:
    passed = sum(each.passed for each in gate.runs)
    assert len(gate.runs) == RUNS
    assert gate.passed
    assert 0 < passed < RUNS, "a gate may pass although a run fails"
    assert gate.rate == passed / RUNS
    assert (gate.lower or 1) < gate.rate < (gate.upper or 0)
    assert repr(gate) == f"GateOutcome(name='slip', status='passed', passed {passed} of 7 runs)"


def test_a_run_of_a_gate_is_found_by_its_name(with_gate: Results, gate: GateOutcome) -> None:
    last = gate.runs[-1]
    assert with_gate[last.name] is last
    assert last.trace.time.size
    with pytest.raises(KeyError):
        with_gate["slip[friction=9]"]


def test_texts_of_a_gate_show_its_failed_runs(with_gate: Results, gate: GateOutcome) -> None:
    failed = next(each.name for each in gate.runs if not each.passed)
    assert f"{failed.removeprefix('slip')} failed (travelled" in gate.text
    assert gate.text in with_gate.text
    assert "slip" in gate._repr_html_()


def test_loaded_runs_of_a_gate_form_it_again(tmp_path: Path, gate: GateOutcome) -> None:
    (tmp_path / "slip.sim.yml").write_text(slips().to_yaml())
    scenarios = load(tmp_path, allow_outside=True)
    assert {each.gate for each in scenarios} == {"slip"}
    again = run(scenarios, report=False, allow_outside=True)
    assert again.gates[0].statistics == gate.statistics
    failed = next(number for number, outcome in enumerate(gate.runs) if not outcome.passed)
    some = run(scenarios[failed], report=False, allow_outside=True)
    assert ([outcome.status for outcome in some], some.gates, some.passed) == (["failed"], (), False)
    # Copies of runs say nothing new, and would make a gate too sure.
    some = run([*scenarios, *scenarios[:1]], report=False, allow_outside=True)
    assert (len(some), some.gates) == (RUNS + 1, ())
