"""The hand-written tests of `make bench` pass, and the comparisons count and print what they should."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from sim_action.scenario.loading import load_scenario
from tools.bench.by_hand import comparisons
from tools.bench.by_hand.__main__ import main
from tools.bench.by_hand.comparisons import PYTHON_VARIABLE, Settings, husky, ours, pytest_command, scenario_execution
from tools.bench.by_hand.processes import Command, Cost, Costs, compared, measure, take_turns
from tools.bench.by_hand.with_mujoco import record as with_mujoco
from tools.bench.table import NotMeasuredError

ENGINES = [pytest.param("pybullet", marks=pytest.mark.pybullet), "mujoco"]
JUNIT = '<testsuite><testcase name="a"/><testcase name="b"><failure/></testcase></testsuite>'


@pytest.mark.process
@pytest.mark.parametrize(("engine", "tests"), [pytest.param("pybullet", 4, marks=pytest.mark.pybullet), ("mujoco", 3)])
def test_the_hand_written_tests_pass(engine: str, tests: int, tmp_path: Path) -> None:
    # The suite is the variations with other speeds, and lasts longer.
    chosen = "-k=not suite and not 30_s"
    command = pytest_command(tmp_path, engine, "", chosen, tests=tests, VARIATIONS="2")
    assert measure(command).cpu > 0


@pytest.mark.process
def test_a_hand_written_suite_runs_on_two_processes(tmp_path: Path) -> None:
    test = "test_suite.py::test_burger_drives_upright[0.91]"
    measure(pytest_command(tmp_path, "mujoco", test, "-p", "xdist", "-n", "2"))


@pytest.mark.pybullet
def test_the_loop_in_pybullet_keeps_the_full_state() -> None:
    from tools.bench.by_hand.with_pybullet import record as with_pybullet

    rows = with_pybullet.record(1)  # type: ignore[no-untyped-call]  # as users write it
    assert len(rows) == 24 + 240
    assert {len(row) for row in rows} == {7 + 6 + 2 * 3}
    assert rows[-1][0] - rows[23][0] == pytest.approx(0.5, abs=0.03)


def test_the_loop_in_mujoco_keeps_the_full_state() -> None:
    rows = with_mujoco.record(1)  # type: ignore[no-untyped-call]  # as users write it
    assert rows.shape == (24 + 240, 7 + 2 + 6 + 2 + 2)
    assert rows[-1][0] - rows[23][0] == pytest.approx(0.5, abs=0.03)


@pytest.mark.process
@pytest.mark.parametrize("engine", ENGINES)
def test_our_side_of_a_comparison_passes(engine: str, tmp_path: Path) -> None:
    (tmp_path / "one.sim.yml").write_text(comparisons._ONE.format(engine=engine))
    assert measure(ours(tmp_path, "--no-report")).cpu > 0


@pytest.mark.parametrize("engine", ENGINES)
def test_all_scenarios_are_valid(engine: str, tmp_path: Path) -> None:
    texts = [
        comparisons._SUITE.format(engine=engine, speed=0.6),
        comparisons._VARIATIONS.format(engine=engine, samples=1),
    ]
    for number, text in enumerate(texts):
        path = tmp_path / f"{number}.sim.yml"
        path.write_text(text)
        assert load_scenario(path).scenario.backend == engine


@pytest.mark.pybullet
@pytest.mark.parametrize(("travel", "duration"), [("1.5 m", "10 ms"), ("20 m", "30 s")])
def test_the_husky_is_valid(travel: str, duration: str, tmp_path: Path) -> None:
    data = pytest.importorskip("pybullet_data")
    shutil.copytree(Path(data.getDataPath()) / "husky", tmp_path / "husky")
    path = tmp_path / "husky.sim.yml"
    path.write_text(comparisons._HUSKY.format(travel=travel, duration=duration))
    assert load_scenario(path).scenario.robot.model == "husky/husky.urdf"


def python(folder: Path, program: str, **options: int | str) -> Command:
    return Command((sys.executable, "-c", program), folder, **options)  # type: ignore[arg-type]  # of one of two types each


def write_junit(text: str) -> str:
    return f"from pathlib import Path; Path('a.xml').write_text({text!r})"


@pytest.mark.process
def test_a_process_must_pass_as_many_tests_as_expected(tmp_path: Path) -> None:
    measure(python(tmp_path, write_junit(JUNIT), junit="a.xml", tests=1))
    with pytest.raises(ValueError, match="passed 1 tests, not 2"):
        measure(python(tmp_path, write_junit(JUNIT), junit="a.xml", tests=2))


@pytest.mark.process
def test_a_process_that_fails_is_not_measured(tmp_path: Path) -> None:
    with pytest.raises(subprocess.CalledProcessError) as failed:
        measure(python(tmp_path, "print('no such robot'); raise SystemExit(3)"))
    assert failed.value.returncode == 3
    assert failed.value.output == "no such robot\n"


@pytest.mark.process
def test_the_junit_xml_of_an_earlier_round_does_not_count(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(JUNIT)
    with pytest.raises(FileNotFoundError):
        measure(python(tmp_path, "pass", junit="a.xml"))


def test_commands_take_turns_in_both_orders(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    called: list[str] = []

    def counted(command: Command) -> Cost:
        called.append(command.arguments[0])
        return Cost(len(called), 2 * len(called))

    monkeypatch.setattr("tools.bench.by_hand.processes.measure", counted)
    first, second = take_turns(3, Command(["a"], tmp_path), Command(["b"], tmp_path))
    assert called == ["a", "b", *"ab", *"ba", *"ab"]
    assert [cost.cpu for cost in first.rounds] == [3, 6, 7]
    assert (second.cpu, second.least_cpu, second.wall) == (5, 4, 10)
    called.clear()
    take_turns(2, Command(["a"], tmp_path), Command(["b"], tmp_path), warm_up=False)
    assert called == [*"ab", *"ba"]


def test_a_comparison_has_a_bound_on_cpu_and_shows_wall_times() -> None:
    mine, theirs = Costs([Cost(3, 2), Cost(1, 2), Cost(2, 2)]), Costs([Cost(1, 1)])
    ratio, walls = compared("a job", mine, theirs, 2)
    assert str(ratio) == "ok   a job: 2.00 (at most 2; 2e+03 ms / 1e+03 ms)"
    assert str(walls) == "     a job: wall time 2.00 (2 s / 1 s); least CPU 1.00"


@pytest.mark.process
@pytest.mark.pybullet
def test_scenario_execution_is_named_with_the_remedy_where_it_is_missing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    taken: list[int] = []

    def turns(rounds: int, *commands: Command) -> list[Costs]:
        taken.append(len(commands))
        return [Costs([Cost(1, 1)]) for _ in commands]

    monkeypatch.setattr(comparisons, "take_turns", turns)
    monkeypatch.setenv(PYTHON_VARIABLE, str(tmp_path / "no-python"))
    with pytest.raises(NotMeasuredError, match=f"{PYTHON_VARIABLE}: "):
        list(husky(Settings(tmp_path)))
    monkeypatch.setenv(PYTHON_VARIABLE, shutil.which("false") or "false")
    (tmp_path / "again").mkdir()
    with pytest.raises(NotMeasuredError, match="has the steps"):
        list(husky(Settings(tmp_path / "again")))
    assert taken == [2] * 4


@pytest.mark.process
@pytest.mark.pybullet
def test_scenario_execution_is_measured_where_it_is_installed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def turns(rounds: int, *commands: Command) -> list[Costs]:
        assert [command.arguments[0] for command in commands][2] == str(program)
        return [Costs([Cost(1, 1)]), Costs([Cost(1, 1)]), Costs([Cost(4, 4)])]

    program = shutil.which("true") or "true"
    monkeypatch.setattr(comparisons, "take_turns", turns)
    monkeypatch.setenv(PYTHON_VARIABLE, program)
    lines = [str(line) for line in husky(Settings(tmp_path))]
    assert "ok   pybullet: husky, 30 s, against scenario_execution: 0.25 (at most 0.5; 1e+03 ms / 4e+03 ms)" in lines
    assert "0.004166666666666667" in scenario_execution(tmp_path).arguments


def test_the_command_line_measures_the_rows_that_are_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    costs = {"pybullet": (1.0, 2.0), "mujoco": (3.0, 2.0)}
    monkeypatch.setattr(comparisons, "step_costs", lambda engine, _: costs[engine])
    with pytest.raises(SystemExit) as end:
        main(["--only", "steps", "--engine", "pybullet", "--rounds", "1"])
    assert end.value.code == 0
    with pytest.raises(SystemExit) as end:
        main(["--only", "steps"])
    assert end.value.code == 1
    lines = capsys.readouterr().out.splitlines()
    assert [line[:14] for line in lines if line[0] != " "] == ["ok   pybullet:", "ok   pybullet:", "MISS mujoco: a"]
