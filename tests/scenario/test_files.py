"""From files to scenarios: `extends`, with every error in the file that it is of."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from sim_action.core.errors import InvalidScenario, Location, MissingScenario
from sim_action.core.permissions import Permissions
from sim_action.core.workspace import OUTSIDE_REMEDY
from sim_action.results.outcome import Outcome
from sim_action.scenario.files import MAX_BASES, MAX_SCENARIOS, read_file
from sim_action.scenario.loading import build_scene, load_all, load_scenario
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.source import Refused, Source
from tests.scenarios import LEAST

PART = LEAST.replace("name: burger drives straight\n", "")


def write(folder: Path, **texts: str) -> None:
    """Files by the last part of their names: `a` is a scenario, `b_base` a base."""
    for name, text in texts.items():
        (folder / f"{name.replace('_base', '.base')}{'' if '_base' in name else '.sim'}.yml").write_text(text)


def told(path: Path) -> list[str]:
    with pytest.raises(InvalidScenario) as refused:
        load_scenario(path)
    return [str(problem).replace(f"{path.parent}/", "") for problem in refused.value.problems]


def test_a_scenario_is_what_its_base_says_and_what_it_says_itself(tmp_path: Path) -> None:
    write(tmp_path, b_base=PART, a="extends: b.base.yml\nname: short\nrobot: {pose: {x: 1}}\ntime_limit: 10 s\n")
    scenario = load_scenario(tmp_path / "a.sim.yml").scenario
    assert (scenario.name, scenario.time_limit, scenario.robot.model) == ("short", 10.0, "turtlebot3_burger")
    assert scenario.robot.pose.x == 1.0
    assert scenario.expect[0].location.file == str(tmp_path / "b.base.yml")
    assert scenario.expect[0].location.line == 8
    assert scenario.extends is None


def test_a_base_may_extend_another_and_be_a_scenario_itself(tmp_path: Path) -> None:
    write(tmp_path, c=LEAST, b_base="extends: c.sim.yml\nduration: 5 s\n", a="extends: b.base.yml\nname: last\n")
    scenario = load_scenario(tmp_path / "a.sim.yml").scenario
    assert (scenario.name, scenario.duration, scenario.time_limit) == ("last", 5.0, 30.0)


def test_every_problem_is_told_in_its_own_file(tmp_path: Path) -> None:
    scenario = "extends: b.base.yml\nname: x\nrobot: {psoe: {}}\ntime_limit: 30 kg\n"
    write(tmp_path, b_base=PART.replace("linear: 1.0", "linear: fast"), a=scenario)
    assert [problem.split(": ")[:2] for problem in told(tmp_path / "a.sim.yml")] == [
        ["a.sim.yml:3:9", "robot.psoe"],
        ["a.sim.yml:4:1", "time_limit"],
        ["b.base.yml:6:8", "commands.twist.0.linear"],
    ]


def test_files_that_a_base_names_lie_beside_the_base(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for folder in ("lib/models", "suite/deep"):
        (tmp_path / folder).mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    urdf = '<robot name="box"><link name="l"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" '
    Path("lib/models/box.urdf").write_text(f'{urdf}iyz="0" izz="1"/></inertial></link></robot>')
    Path("lib/stand.py").write_text("def control(observation):\n    return None\n")
    Path("lib/box.base.yml").write_text(
        "robot: {model: models/box.urdf, packages: {p: models}}\ncommands: {script: stand.py}\n"
        "expect: [upright]\ntime_limit: 1 s\n"
    )
    Path("suite/deep/a.sim.yml").write_text("extends: ../../lib/box.base.yml\nname: a\n")
    loaded = load_scenario(Path("suite/deep/a.sim.yml"))
    assert build_scene(loaded).model.name == "box"
    assert loaded.scenario.robot.packages == {"p": "../../lib/models"}
    assert loaded.scenario.expect[0].location.file == "lib/box.base.yml"


def test_a_built_in_robot_of_a_base_in_another_folder_stays_that(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "lib").mkdir()
    monkeypatch.chdir(tmp_path)
    Path("lib/b.base.yml").write_text(PART)
    Path("a.sim.yml").write_text("extends: lib/b.base.yml\nname: a\n")
    assert load_scenario(Path("a.sim.yml")).scenario.robot.model == "turtlebot3_burger"
    Path("lib/b.base.yml").write_text(PART.replace("turtlebot3_burger", "turtlebot3_burgr"))
    (problem,) = told(Path("a.sim.yml"))
    assert problem.startswith("lib/b.base.yml:2:3: robot.model: unknown robot 'turtlebot3_burgr'; did you mean")


@pytest.mark.parametrize(
    ("extends", "problem"),
    [
        ("bse.base.yml", "'bse.base.yml' does not exist (looked for bse.base.yml); did you mean 'b.base.yml'?"),
        ("a.sim.yml", "the files extend each other in a circle: a.sim.yml -> a.sim.yml"),
        ("loop.base.yml", "the files extend each other in a circle: a.sim.yml -> loop.base.yml -> a.sim.yml"),
        ("/etc/hostname", "'/etc/hostname' is outside the workspace {folder}; " + OUTSIDE_REMEDY),
        ("../x.base.yml", "'../x.base.yml' is outside the workspace {folder}; " + OUTSIDE_REMEDY),
        ("[b.base.yml]", "expected the path of one file, found a list of 1"),
        (".", "'.' is a folder, not a file (looked for {folder})"),
        ("", "expected the path of one file, found nothing"),
    ],
)
def test_what_cannot_be_extended(extends: str, problem: str, tmp_path: Path) -> None:
    write(tmp_path, b_base=PART, loop_base="extends: a.sim.yml\n", a=f"name: a\nextends: {extends}\n")
    (line,) = told(tmp_path / "a.sim.yml")
    place = "loop.base.yml:1:1" if extends == "loop.base.yml" else "a.sim.yml:2:1"
    assert line == f"{place}: extends: {problem.format(folder=tmp_path)}"


def test_a_base_that_is_a_link_out_of_the_workspace_is_outside(tmp_path: Path) -> None:
    workspace = tmp_path / "w"
    workspace.mkdir()
    (tmp_path / "x.yml").write_text(PART)
    (workspace / "b.base.yml").symlink_to(tmp_path / "x.yml")
    write(workspace, a="name: a\nextends: b.base.yml\n")
    (problem,) = told(workspace / "a.sim.yml")
    assert "is outside the workspace" in problem


def test_what_is_wrong_with_the_text_of_a_base_is_told_there(tmp_path: Path) -> None:
    write(tmp_path, b_base="a: [\n", a="extends: b.base.yml\n")
    (problem,) = told(tmp_path / "a.sim.yml")
    assert problem.startswith("b.base.yml:2:1: not valid YAML")
    write(tmp_path, b_base="")
    assert told(tmp_path / "a.sim.yml")[0].startswith("b.base.yml:1:1: the file is empty")
    (tmp_path / "b.base.yml").unlink()
    os.mkfifo(tmp_path / "b.base.yml")
    assert "b.base.yml" in told(tmp_path / "a.sim.yml")[0]


def test_a_chain_has_an_end(tmp_path: Path) -> None:
    for number in range(MAX_BASES + 2):
        below = f"extends: {number + 1}.base.yml\n" if number <= MAX_BASES else PART
        (tmp_path / f"{number}.base.yml").write_text(below)
    (tmp_path / "a.sim.yml").write_text("name: a\nextends: 2.base.yml\n")
    assert load_scenario(tmp_path / "a.sim.yml").scenario.name == "a"
    (tmp_path / "a.sim.yml").write_text("name: a\nextends: 0.base.yml\n")
    (problem,) = told(tmp_path / "a.sim.yml")
    assert problem.endswith(f"extends: more than {MAX_BASES} files extend each other")


def test_two_of_a_kind_from_two_files_are_told_so(tmp_path: Path) -> None:
    write(tmp_path, b_base=PART, a="extends: b.base.yml\nname: a\ncommands: {script: stop.py}\n")
    (problem,) = told(tmp_path / "a.sim.yml")
    assert problem == (
        "a.sim.yml:3:12: commands.script: 'twist' of b.base.yml stands beside it; take that out with 'twist: null'"
    )
    write(tmp_path, a="extends: b.base.yml\nname: a\ncommands: {twist: null, script: stop.py}\n")
    (tmp_path / "stop.py").write_text("def control(observation):\n    return None\n")
    assert load_scenario(tmp_path / "a.sim.yml").scenario.runs_user_code


def several(folder: Path, text: str) -> tuple[Source | Refused, ...]:
    (folder / "many.sim.yml").write_text(text)
    return read_file(folder / "many.sim.yml", Permissions())


SHARED = "".join(line for line in LEAST.splitlines(keepends=True) if "name" not in line)


def test_a_file_may_hold_several_scenarios_on_what_stands_beside_them(tmp_path: Path) -> None:
    text = f"scenarios:\n  - name: far\n  - name: near\n    robot: {{pose: {{x: 1}}}}\n    time_limit: 5 s\n{SHARED}"
    far, near = load_all(several(tmp_path, text), Permissions())
    assert isinstance(far, LoadedScenario)
    assert isinstance(near, LoadedScenario)
    assert (far.scenario.name, near.scenario.name) == ("far", "near")
    assert (far.scenario.time_limit, near.scenario.time_limit) == (30.0, 5.0)
    assert near.scenario.robot.pose.x == 1.0
    assert near.scenario.robot.model == "turtlebot3_burger"
    assert (far.source.line, near.source.line) == (2, 3)
    assert near.scenario.expect[0].location.line == 13
    assert far.model is near.model


def test_what_is_wrong_with_one_leaves_the_others(tmp_path: Path) -> None:
    text = (
        "scenarios:\n  - {name: good}\n  - {name: bad, time_limit: never}\n  - 7\n  - {name: good}\n"
        f"  - {{name: deep, scenarios: []}}\n  - {{}}\n{SHARED}"
    )
    good, *others = load_all(several(tmp_path, text), Permissions())
    assert isinstance(good, LoadedScenario)
    refused = [scenario for scenario in others if isinstance(scenario, Refused)]
    names = ["bad", "many.sim.yml (3)", "good (2)", "deep", "many.sim.yml (6)"]
    assert [(scenario.name, scenario.line) for scenario in refused] == list(zip(names, range(3, 8), strict=True))
    assert [str(scenario.problems[0]).partition(":")[2] for scenario in refused] == [
        "3:17: time_limit: expected time such as '1 s', found 'never'",
        "4:5: expected a map of keys, found 7",
        "5:6: name: a second scenario named 'good' in this file",
        "6:18: scenarios: is a key of the file, not of one of its scenarios",
        "7:5: name: the key 'name' is missing",
    ]
    assert Outcome.of_refused(refused[0]).location == Location(str(tmp_path / "many.sim.yml"), 3)


@pytest.mark.parametrize(
    ("scenarios", "problem"),
    [
        ("[]", "1:1: scenarios: expected a list of maps, found an empty list"),
        ("{a: 1}", "1:1: scenarios: expected a list of maps, found a map of keys"),
        (f"[{'1, ' * (MAX_SCENARIOS + 1)}]", "1:1: scenarios: more than 1000 scenarios"),
    ],
)
def test_a_list_of_scenarios_that_is_none(scenarios: str, problem: str, tmp_path: Path) -> None:
    (refused,) = several(tmp_path, f"scenarios: {scenarios}\n{SHARED}")
    assert isinstance(refused, Refused)
    assert str(refused.error).removeprefix(f"{tmp_path}/many.sim.yml:").startswith(problem)


def test_a_few_lines_do_not_become_millions_of_values(tmp_path: Path) -> None:
    (refused,) = several(tmp_path, f"scenarios: [{'{}, ' * 1000}]\nexpect: [{'upright, ' * 1000}]\n")
    assert isinstance(refused, Refused)
    assert "too many shared keys" in str(refused.error)


def test_several_scenarios_may_stand_on_one_base(tmp_path: Path) -> None:
    write(tmp_path, b_base=PART)
    found = several(tmp_path, "extends: b.base.yml\nscenarios:\n  - {name: a}\n  - {name: b}\n")
    assert [source.name for source in found] == ["a", "b"]
    write(tmp_path, a="extends: many.sim.yml\nname: c\n")
    (problem,) = told(tmp_path / "a.sim.yml")
    assert problem.endswith("many.sim.yml holds several scenarios; extend a file with one scenario")


def test_a_scenario_that_is_a_link_to_itself_is_refused_with_a_remedy(tmp_path: Path) -> None:
    loop = tmp_path / "loop.sim.yml"
    loop.symlink_to(loop.name)
    (problem,) = told(loop)
    # From Python 3.13 on, the system reports it.
    assert problem.endswith("a link leads to itself; replace it with a file") or "oo many levels" in problem


@pytest.mark.parametrize(
    ("typed", "message"),
    [
        ("simulations", "'simulations'; did you mean 'simulation'? Correct the path on the command line, or in the"),
        ("simulation/note.txt", "'simulation/note.txt'; correct the path"),
        ("no\nsuch", "'no\\nsuch'; correct the path"),
    ],
)
def test_a_missing_file_is_reported_with_the_nearest_one(
    typed: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("simulation").mkdir()
    for name in ("deliver.sim.yml", "notes.txt", ".hidden.sim.yml"):
        Path("simulation", name).touch()
    (refused,) = read_file(Path(typed), Permissions())
    assert isinstance(refused, Refused)
    assert isinstance(refused.error, MissingScenario)
    (problem,) = refused.problems
    assert problem.message.startswith(f"there is no file or folder {message}")
    assert problem.location == Location(typed)


def test_a_missing_file_is_reported_at_the_key_that_names_it(tmp_path: Path) -> None:
    key = Location("pyproject.toml", 3, 1)
    (refused,) = read_file(tmp_path / "a.sim.yml", Permissions(), named_at=key)
    assert isinstance(refused, Refused)
    (problem,) = refused.problems
    assert problem.location == key
    assert problem.message == f"there is no file or folder '{tmp_path}/a.sim.yml'; correct the path"
