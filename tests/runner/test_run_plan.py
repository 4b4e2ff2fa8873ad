"""What each call is to run: everything once, whatever is wrong with some of it."""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import get_args
from unittest.mock import Mock

import pytest
from packaging.requirements import Requirement

from sim_action.core.errors import InvalidScenario, UsageError
from sim_action.core.permissions import Permissions
from sim_action.core.workspace import Workspace, file_name
from sim_action.core.yaml_document import read_document
from sim_action.engines import ENGINES, chosen, installed
from sim_action.results.journal import Finished
from sim_action.results.outcome import Status
from sim_action.runner.child_outcome import unjudged
from sim_action.runner.job import Job
from sim_action.runner.run_plan import EarlyStop, PlanRequest, RunPlan, engine_runs, plan_runs, source_of
from sim_action.scenario.loading import checked, load_scenario
from sim_action.scenario.model import LoadedScenario, Scenario, Unexercised
from sim_action.scenario.selection import Selection, Suite
from sim_action.scenario.source import Refused, Source
from sim_action.scenario.variations.expansion import expanded
from tests.scenarios import LEAST

TEXT = """\
name: stands
robot: {{model: turtlebot3_burger}}
expect: [upright]
{more}
time_limit: 1 s
"""
ENGINE_NAMES = tuple(ENGINES)


@pytest.fixture
def only_pybullet(monkeypatch: pytest.MonkeyPatch) -> None:
    # What Python has for a module that is not to be found.
    monkeypatch.setitem(sys.modules, "mujoco", None)


def loaded(folder: Path, more: str = "") -> LoadedScenario:
    path = folder / "stands.sim.yml"
    path.write_text(TEXT.format(more=more))
    return load_scenario(path)


def engines(folder: Path, more: str = "", backend: str | None = None) -> list[tuple[str, str]]:
    return [(run.scenario.name, run.scenario.backend) for run in engine_runs(loaded(folder, more), backend)]


def test_a_scenario_may_name_every_engine_there_is() -> None:
    assert get_args(Scenario.model_fields["backend"].annotation) == ("auto", *ENGINE_NAMES)


@pytest.mark.pybullet
def test_auto_is_the_first_that_is_installed(tmp_path: Path) -> None:
    assert installed() == ENGINE_NAMES
    assert engines(tmp_path) == [("stands", "pybullet")]


def test_auto_is_another_where_the_first_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pybullet", None)
    assert engines(tmp_path) == [("stands", "mujoco")]


@pytest.mark.pybullet
@pytest.mark.parametrize("engine", ENGINE_NAMES)
def test_what_the_file_says_counts_and_what_was_typed_counts_more(engine: str, tmp_path: Path) -> None:
    (other,) = set(ENGINE_NAMES) - {engine}
    assert engines(tmp_path, f"backend: {engine}") == [("stands", engine)]
    assert engines(tmp_path, f"backend: {engine}", other) == [("stands", other)]
    assert engines(tmp_path, "agreement: {yaw: 1 deg}", engine) == [("stands", engine)]


@pytest.mark.pybullet
@pytest.mark.parametrize(("more", "backend"), [("", "all"), ("backend: mujoco", "all"), ("agreement: {yaw: 1}", None)])
def test_on_several_each_run_has_the_name_of_its_engine(more: str, backend: str | None, tmp_path: Path) -> None:
    assert engines(tmp_path, more, backend) == [("stands [pybullet]", "pybullet"), ("stands [mujoco]", "mujoco")]


@pytest.mark.pybullet
@pytest.mark.parametrize(
    ("more", "backend", "compared"), [("", "all", 2), ("agreement: {yaw: 1}", None, 2), ("", None, 0)]
)
def test_runs_on_several_engines_are_compared(more: str, backend: str | None, compared: int, tmp_path: Path) -> None:
    assert sum(run.compared for run in engine_runs(loaded(tmp_path, more), backend)) == compared


@pytest.mark.pybullet
def test_a_run_of_too_many_steps_is_not_compared(tmp_path: Path) -> None:
    path = tmp_path / "long.sim.yml"
    path.write_text(TEXT.format(more="physics: {rate: 240 Hz}").replace("1 s", "8400 s"))
    assert not any(run.compared for run in engine_runs(load_scenario(path), "all"))
    path.write_text(TEXT.format(more="agreement: {yaw: 1 deg}").replace("1 s", "8400 s"))
    with pytest.raises(
        InvalidScenario, match=r"long\.sim\.yml:4:1: agreement: compares at most 2,000,000 physics steps"
    ):
        load_scenario(path)


@pytest.mark.pybullet
@pytest.mark.usefixtures("only_pybullet")
@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("backend: mujoco", "4:1: backend: the engine mujoco is not installed; installed: pybullet"),
        ("agreement: {yaw: 1}", "4:1: agreement: a comparison needs two engines; installed: pybullet"),
    ],
)
def test_an_engine_that_the_file_asks_for_is_told_on_its_line(more: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidScenario, match=r"stands\.sim\.yml:4:1") as refused:
        engines(tmp_path, more)
    assert message in str(refused.value.problems[0])


@pytest.mark.pybullet
@pytest.mark.usefixtures("only_pybullet")
@pytest.mark.parametrize("backend", ["mujoco", "all"])
def test_an_engine_that_was_typed_and_is_not_there_ends_the_call(backend: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="installed: "):
        engines(tmp_path, backend=backend)


@pytest.mark.usefixtures("only_pybullet")
def test_without_any_engine_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(UsageError, match="pip install mujoco-core"):
        chosen("auto")


def test_an_agreement_asks_something_and_needs_several_engines(tmp_path: Path) -> None:
    with pytest.raises(InvalidScenario, match="agreement: must have 'position', 'yaw', 'joints', 'links', 'bodies' or"):
        loaded(tmp_path, "agreement: {}")
    with pytest.raises(
        InvalidScenario, match=r"5:1: backend: remove it: 'agreement' runs the scenario on every engine"
    ):
        loaded(tmp_path, "agreement: {yaw: 1}\nbackend: mujoco")


BALL = "world: {objects: [{name: ball, sphere: {radius: 0.1}, mass: 1, pose: {x: 3}}, {name: wall, box: [1, 1, 1]}]}"


@pytest.mark.parametrize(
    ("agreement", "message"),
    [
        ("{joints: {wheel_lft_joint: 1 deg}}", "5:22: agreement.joints.wheel_lft_joint: the model has no moving joint"),
        ("{joints: {wheel_lft_joint: 1 deg}}", "did you mean 'wheel_left_joint'?"),
        ("{joints: {'wheel_*': 1 cm}}", "joint 'wheel_left_joint' turns: 'cm' is not a unit of angle"),
        ("{joints: {wheel_left_joint: 0}}", "the allowed difference of 'wheel_left_joint' must be greater than 0"),
        ("{links: {base_scn: {position: 1 cm}}}", "the robot has no link 'base_scn'; did you mean 'base_scan'?"),
        ("{links: {base_scan: {}}}", "must have 'position', 'orientation' or both"),
        ("{links: {base_scan: {orientation: 180 deg}}}", "two orientations are at most 180 deg apart"),
        ("{yaw: 180 deg}", "two headings are at most 180 deg apart"),
        ("{bodies: {bal: {position: 1 cm}}}", "the world has no body 'bal'; did you mean 'ball'?"),
        ("{bodies: {wall: {position: 1 cm}}}", "body 'wall' is fixed, so it is at the same place in every engine"),
    ],
)
def test_an_agreement_names_what_there_is(agreement: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidScenario) as refused:
        loaded(tmp_path, f"{BALL}\nagreement: {agreement}")
    assert message in "\n".join(map(str, refused.value.problems))


ARM = """\
<robot name="arm">
  <link name="base"/>
  <link name="tip">
    <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="elbow" type="continuous"><parent link="base"/><child link="tip"/><axis xyz="0 1 0"/></joint>
</robot>
"""


@pytest.mark.parametrize(
    ("agreement", "message"),
    [
        ("{position: 1 cm}", "'position' compares the base of the robot, but it is fixed and never moves"),
        ("{position: 1 cm, yaw: 1 deg}", "'position' and 'yaw' compare the base of the robot, but it is fixed"),
        ("{yaw: 1 deg, joints: {elbow: 1 deg}}", "such as joints: {elbow: 0.5 deg} [fixed-base]"),
        ("{links: {base: {position: 1 cm}}}", "link 'base' is fixed to the world and never moves"),
        ("{links: {tip: {position: 1 cm}}, joints: {elbow: 1 deg}}", None),
    ],
)
def test_agreement_of_a_fixed_robot_is_about_moving_parts(agreement: str, message: str | None, tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(ARM)
    path = tmp_path / "arm.sim.yml"
    path.write_text(
        "name: arm\nrobot: {model: arm.urdf, base: fixed}\nexpect: [{joint: {name: elbow, at_most: 90 deg}}]\n"
        f"agreement: {agreement}\ntime_limit: 1 s\n"
    )
    if message is None:
        assert load_scenario(path).scenario.agreement is not None
        return
    with pytest.raises(InvalidScenario, match=r"arm\.sim\.yml:4:") as refused:
        load_scenario(path)
    assert message in str(refused.value.problems[0])


ANT = '<mujoco><worldbody><body name="ant"><freejoint/><geom size="0.1" mass="1"/></body></worldbody></mujoco>'


def ant(folder: Path, more: str = "") -> LoadedScenario:
    (folder / "ant.xml").write_text(ANT)
    (folder / "ant.sim.yml").write_text(TEXT.format(more=more).replace("turtlebot3_burger", "ant.xml"))
    return load_scenario(folder / "ant.sim.yml")


@pytest.mark.parametrize("backend", [None, "mujoco", "all"])
def test_a_model_of_mujocos_own_runs_there(backend: str | None, tmp_path: Path) -> None:
    (run,) = engine_runs(ant(tmp_path), backend)
    assert (run.scenario.name, run.scenario.backend, run.model) == ("stands", "mujoco", None)


@pytest.mark.parametrize(
    ("more", "backend", "message"),
    [
        ("", "pybullet", "2:9: robot.model: PyBullet reads most of MJCF without its joints"),
        ("backend: pybullet", None, "2:9: robot.model: PyBullet reads most of MJCF without its joints"),
        ("agreement: {yaw: 1}", None, "4:1: agreement: ant.xml is a model for MuJoCo only"),
    ],
)
def test_a_model_of_mujocos_own_runs_nowhere_else(more: str, backend: str | None, message: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidScenario) as refused:
        engine_runs(ant(tmp_path, more), backend)
    assert message in str(refused.value.problems[0])


@pytest.mark.pybullet
@pytest.mark.usefixtures("only_pybullet")
def test_a_model_of_mujocos_own_is_told_where_mujoco_is_missing(tmp_path: Path) -> None:
    with pytest.raises(InvalidScenario, match=r"2:9: robot\.model: an \.xml file is a model for MuJoCo; the engine"):
        engine_runs(ant(tmp_path), None)


def test_a_model_of_mujocos_own_is_not_read_before_it_runs(tmp_path: Path) -> None:
    assert ant(tmp_path).unchecked == ("links and joints of ant.xml: MuJoCo reads the file when the scenario runs",)


@pytest.mark.parametrize(
    ("system", "machine", "python", "engines"),
    [
        ("linux", "x86_64", "3.11", ["pybullet"]),
        ("linux", "x86_64", "3.12", ["mujoco-core"]),
        ("linux", "aarch64", "3.11", ["mujoco-core"]),
        ("darwin", "arm64", "3.11", ["mujoco-core"]),
        ("darwin", "x86_64", "3.11", []),
        ("win32", "AMD64", "3.14", ["mujoco-core"]),
        ("win32", "ARM64", "3.12", []),
    ],
)
def test_what_is_installed_has_wheels_there(system: str, machine: str, python: str, engines: list[str]) -> None:
    file = Path(__file__).parents[2] / "pyproject.toml"
    needed = map(Requirement, tomllib.loads(file.read_text())["project"]["dependencies"])
    here = {"sys_platform": system, "platform_machine": machine, "python_version": python}
    assert [each.name for each in needed if each.marker and each.marker.evaluate(here)] == engines


SHARED = LEAST.partition("\n")[2]
FILES = {
    "a.sim.yml": f"scenarios:\n  - {{name: one}}\n  - {{name: two, time_limit: no}}\n  - {{name: three}}\n{SHARED}",
    "b.sim.yml": f"name: push\nvariations: {{robot.pose.x: [0, 1, 2, 3, 4]}}\n{SHARED}",
    "c.sim.yml": f"name: broken\nvariations: {{robot.pose.x: [0, 1, far, 3]}}\n{SHARED}",
    "d.sim.yml": "name: [",
    "e.sim.yml": LEAST,
}
PUSHES = [f"push[x={x}]" for x in range(5)]
NAMES = ["one", "two", "three", *PUSHES, "broken", "d.sim.yml", "burger drives straight"]


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    return [tmp_path / name for name in FILES]


def plan(suite: Suite, shard: str | None = None) -> RunPlan:
    return plan_runs(PlanRequest(suite, Permissions(), shard, None, None))


@pytest.mark.parametrize(
    ("typed", "own", "used"),
    [(None, None, None), ("warn", None, "warn"), ("warn", "error", "error"), ("error", "warn", "warn")],
)
def test_the_key_of_a_scenario_wins_over_the_command_line(
    typed: Unexercised | None, own: Unexercised | None, used: Unexercised | None, tmp_path: Path
) -> None:
    path = tmp_path / "a.sim.yml"
    path.write_text(TEXT.format(more=f"unexercised: {own}" if own else ""))
    (planned,) = plan_runs(PlanRequest(Suite([path]), Permissions(), None, None, None, typed)).plans
    assert isinstance(planned, tuple)
    assert planned[0].scenario.unexercised == used


def names(found: RunPlan) -> list[str]:
    return [source_of(each).name for each in found.plans]


def test_without_shards_it_is_everything(files: list[Path]) -> None:
    found = plan(Suite(files, ("nope*",)))
    assert names(found) == NAMES
    assert [source_of(each).name for each in found.plans if isinstance(each, Refused)] == ["two", "broken", "d.sim.yml"]
    assert (found.shard, list(found.empty)) == (None, ["nope*"])


@pytest.mark.parametrize("count", [1, 2, 3, 20])
def test_shards_have_every_scenario_once_by_its_place_in_the_list_alone(files: list[Path], count: int) -> None:
    parts = [plan(Suite(files, ("nope*",)), f"{index}/{count}") for index in range(1, count + 1)]
    assert [names(part) for part in parts] == [NAMES[index::count] for index in range(count)]
    assert {part.shard.total for part in parts if part.shard} == {len(NAMES) + 1}
    assert [list(part.empty) for part in parts] == [["nope*"]] + [[]] * (count - 1)


@pytest.mark.parametrize("count", [1, 3])
def test_a_pattern_that_matches_nothing_is_told_by_the_first_shard_alone(files: list[Path], count: int) -> None:
    suite = Suite(files, ("nope*",), selection=Selection(only=("*", "nobody"), tags=()))
    parts = [plan(suite, f"{index}/{count}") for index in range(1, count + 1)]
    assert {part.shard.total for part in parts if part.shard} == {len(NAMES) + 2}
    assert [[each.name for each in part.unmatched] for part in parts] == [["--only nobody"]] + [[]] * (count - 1)


def test_numbers_leave_scenarios_of_other_numbers_to_others(files: list[Path]) -> None:
    def some(path: Path, *numbers: int) -> list[str]:
        return names(plan(Suite([path], numbers={file_name(path): frozenset(numbers)})))

    assert some(files[0], 1, 2) == ["one", "two"]
    assert some(files[1], 2, 4) == ["push[x=1]", "push[x=3]"]
    # What stops all variations is told by whoever has the first.
    assert some(files[2], 1, 2) == ["broken"]
    assert some(files[2], 3, 4) == []


def test_shards_share_what_was_read_for_variations(files: list[Path]) -> None:
    found = plan(Suite(files[:2]), "1/2")
    models = [each[0].model for each in found.plans if not isinstance(each, Refused)]
    assert len(models) == 4
    assert all(model is models[0] is not None for model in models)


GATE = "stop_early: {reject: 20 %, accept: 80 %, confidence: 90 %}"


def gated(folder: Path, gate: str, runs: int = 12, file: str = "s.sim.yml") -> list[LoadedScenario]:
    text = f"{LEAST}variations: {{robot.pose.x: {{uniform: [0 m, 1 m]}}}}\ngate: {{{gate}, runs: {runs}}}\n"
    source = Source(folder / file, Workspace(folder, folder), read_document(file, text), "push")
    return [checked(each, Permissions()) for each in expanded(source, None)]


def end(stop: EarlyStop, runs: Sequence[LoadedScenario], place: int, status: Status) -> None:
    stop(Finished(place, unjudged(runs[place]).model_copy(update={"status": status})))


@pytest.mark.parametrize("status", ["passed", "failed"])
def test_runs_after_the_decision_are_needless(tmp_path: Path, status: Status) -> None:
    runs = gated(tmp_path, GATE)
    stop = EarlyStop(runs, range(len(runs)))
    for place in range(2):
        assert not stop.is_needless(11)
        end(stop, runs, place, status)
    assert all(stop.is_needless(place) for place in range(2, 12))


def test_gates_that_are_not_decided(tmp_path: Path) -> None:
    # A run that is still missing hides later ones.
    runs = gated(tmp_path, GATE)
    stop = EarlyStop(runs, range(len(runs)))
    for place in (1, 2, 3):
        end(stop, runs, place, "passed")
    assert not stop.is_needless(11)
    end(stop, runs, 0, "passed")
    assert stop.is_needless(11)
    # A run that was skipped is no result.
    runs = gated(tmp_path, GATE)
    stop = EarlyStop(runs, range(len(runs)))
    end(stop, runs, 0, "skipped")
    for place in range(1, 6):
        end(stop, runs, place, "passed")
    assert not stop.is_needless(11)


def test_runs_of_other_gates_and_of_parts(tmp_path: Path) -> None:
    # Runs of other gates and of none are needed.
    runs = gated(tmp_path, "passes: {at_least: 50 %}")
    stop = EarlyStop(runs, range(len(runs)))
    for place in range(8):
        end(stop, runs, place, "passed")
    assert not any(stop.is_needless(place) for place in range(20))
    # A part of a gate is not decided.
    runs = gated(tmp_path, GATE)[::2]
    stop = EarlyStop(runs, range(len(runs)))
    for place in range(6):
        end(stop, runs, place, "passed")
    assert not stop.is_needless(5)
    # Gates of one name in two files are two gates.
    runs = gated(tmp_path, GATE, file="a.sim.yml") + gated(tmp_path, GATE, file="b.sim.yml")
    stop = EarlyStop(runs, range(len(runs)))
    for place in range(2):
        end(stop, runs, place, "passed")
    assert [stop.is_needless(place) for place in (11, 12, 23)] == [True, False, False]


@pytest.mark.parametrize(
    ("path", "name"), [("/out/traces/a.npz", "traces/a.npz"), ("/elsewhere/a.npz", "../elsewhere/a.npz")]
)
def test_a_file_is_named_from_the_folder_of_the_results(path: str, name: str) -> None:
    assert Job(Mock(), Path(path), Path("/out")).trace_name == name
