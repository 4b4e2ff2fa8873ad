"""Scenarios that a program builds, or reads from files and changes."""

from __future__ import annotations

import pickle
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import InvalidScenario, UsageError
from sim_action.core.permissions import Permissions
from sim_action.core.yaml_document import read_document
from sim_action.parts import AllOf, AnyOf, DiffDrive, DrivenRobot, Lidar, Negation, Reach, Travel, Upright
from sim_action.scenario.loading import checked
from sim_action.scenario.source import Source
from sim_action.scenario.written import Scenario

BURGER: dict[str, Any] = {
    "name": "burger drives",
    "robot": {"model": "turtlebot3_burger"},
    "commands": {"twist": [{"linear": 0.5}]},
    "expect": [Travel(at_least=1.5)],
    "time_limit": 30,
}


def only(scenario: Scenario) -> Source:
    (source,) = scenario.sources(Permissions())
    assert isinstance(source, Source)
    return source


def test_it_is_checked_like_a_file() -> None:
    loaded = checked(only(Scenario(**BURGER)), Permissions())
    assert loaded.scenario.name == "burger drives"
    assert loaded.scenario.expect[0].assertion == Travel(at_least=1.5)
    assert loaded.file == "burger drives (Python)"


def test_parts_become_what_a_file_has() -> None:
    drive = DiffDrive(left=("wheel_left_joint",), right=("wheel_right_joint",))
    robot = DrivenRobot(model="turtlebot3_burger", drive=drive)
    expect = [
        {"any_of": [Travel.model_validate({"at_least": "150 cm"}), Upright()], "after": 1},
        Upright.model_validate({"max_tilt": "5 deg"}),
    ]
    keys = {**BURGER, "robot": robot, "expect": expect, "sensors": [{"name": "scan", "lidar": Lidar(rays=10)}]}
    written = Scenario(**keys).keys
    assert written["robot"] == {
        "model": "turtlebot3_burger",
        "drive": {"diff": {"left": ["wheel_left_joint"], "right": ["wheel_right_joint"]}},
    }
    assert written["expect"][0] == {"any_of": [{"travel": {"at_least": 1.5}}, {"upright": {}}], "after": 1}
    assert written["expect"][1]["upright"]["max_tilt"] == pytest.approx(np.radians(5))
    assert written["sensors"] == [{"name": "scan", "lidar": {"rays": 10}}]
    loaded = checked(only(Scenario(**keys)), Permissions()).scenario
    assert loaded.robot.drive == drive
    assert isinstance(loaded.expect[0].assertion, AnyOf)


def test_assertions_of_assertions_are_written_as_a_list_or_alone() -> None:
    expect = (AllOf(parts=(Travel(at_least=1), Negation(part=Reach(x=9, y=9)))),)
    assert Scenario(**{**BURGER, "expect": expect}).keys["expect"] == [
        {"all_of": [{"travel": {"at_least": 1.0}}, {"not": {"reach": {"x": 9.0, "y": 9.0}}}]}
    ]


def test_numbers_and_arrays_of_numpy_and_paths_are_written_as_yaml_has_them() -> None:
    changes = {"time_limit": np.float32(2), "seed": np.int64(7), "trace.rate": np.float64(5)}
    keys = Scenario(**BURGER).changed({**changes, "robot.model": Path("a/b")}).keys
    assert (keys["time_limit"], keys["seed"], keys["trace"], keys["robot"]) == (2.0, 7, {"rate": 5.0}, {"model": "a/b"})
    assert type(keys["seed"]) is int
    arrays = Scenario(**BURGER, tags=np.array(["a", "b"]), world={"a": np.eye(2), "b": np.bool_(True)}).keys
    assert (arrays["tags"], arrays["world"]) == (["a", "b"], {"a": [[1.0, 0.0], [0.0, 1.0]], "b": True})
    # Posix paths are the same on every system.
    posix = {**BURGER, "robot": {"model": PurePosixPath("models/arm.urdf")}}
    assert Scenario(**posix).keys["robot"] == {"model": "models/arm.urdf"}


@pytest.mark.parametrize("value", [object(), b"bytes", {1, 2}, {3: "a"}, [1, {"a": print}]])
def test_what_yaml_does_not_have_is_refused_with_its_key(value: object) -> None:
    with pytest.raises(InvalidScenario, match=r"burger drives \(Python\): world\.objects") as error:
        Scenario(**BURGER, world={"objects": value})
    assert len(error.value.problems) == 1


def test_a_list_in_itself_is_refused() -> None:
    value: list[Any] = []
    value.append(value)
    with pytest.raises(InvalidScenario, match="tags: more than 40 nested maps and lists"):
        Scenario(**BURGER, tags=value)


@pytest.mark.parametrize(
    "text",
    ["1e3", "-1E-3", "0o7", "0x1f", ".5", "5.", "1_0", "1:30", "~", "yes", "NULL", ".inf", "=", "", "\x85", "\u2028a"],
)
def test_a_strange_text_stays_as_it_is(text: str) -> None:
    scenario = Scenario(**BURGER, world={text: [text]})
    assert scenario.keys["world"] == {text: [text]}


def test_problems_have_the_line_of_its_text() -> None:
    scenario = Scenario(**BURGER, sead=3)
    with pytest.raises(InvalidScenario, match="did you mean 'seed'") as error:
        checked(only(scenario), Permissions())
    line = error.value.problems[0].location.line
    assert line is not None
    assert scenario.to_yaml().splitlines()[line - 1] == "sead: 3"


def test_a_change_leaves_the_scenario_as_it_was() -> None:
    scenario = Scenario(**BURGER)
    changed = scenario.changed({"name": "other", "expect.0.travel.at_least": "2 m", "robot.pose.yaw": 0.5})
    assert (scenario.name, scenario.keys["expect"]) == ("burger drives", [{"travel": {"at_least": 1.5}}])
    assert (changed.name, changed.keys["expect"]) == ("other", [{"travel": {"at_least": "2 m"}}])
    assert changed.keys["robot"] == {"model": "turtlebot3_burger", "pose": {"yaw": 0.5}}


def test_a_path_that_leads_nowhere_is_refused() -> None:
    with pytest.raises(InvalidScenario, match=r"expect\.1\.travel: expect is a list without '1'"):
        Scenario(**BURGER).changed({"expect.1.travel": 3})


@pytest.mark.parametrize(("changes", "kind"), [(None, "nothing"), (["seed"], "a list of 1"), ({3: 4}, "a map of keys")])
def test_changes_that_are_no_map_of_key_paths_are_refused(changes: Any, kind: str) -> None:
    with pytest.raises(UsageError, match=f"changes: expected a map of key paths to values, found {kind}"):
        Scenario(**BURGER).changed(changes)


def test_variations_have_their_names() -> None:
    scenario = Scenario(**BURGER, variations={"robot.pose.yaw": [0.1, 0.2]})
    names = [source.name for source in scenario.sources(Permissions())]
    assert names == ["burger drives[yaw=0.1]", "burger drives[yaw=0.2]"]


def test_it_says_what_it_is_and_can_be_pickled(tmp_path: Path) -> None:
    scenario = Scenario(**BURGER, tags=["fast"], folder=tmp_path)
    assert repr(scenario) == f"Scenario(name='burger drives', path={str(tmp_path / 'burger drives (Python)')!r})"
    assert (scenario.tags, scenario.line) == (("fast",), None)
    assert pickle.loads(pickle.dumps(scenario)).keys == scenario.keys


@pytest.mark.parametrize("name", [None, 3, "", "a/b", "[x]"])
def test_a_strange_name_is_told_when_it_is_checked(name: object) -> None:
    source = only(Scenario(**{**BURGER, "name": name}))
    if name in ("a/b", "[x]"):
        assert checked(source, Permissions()).scenario.name == name
    else:
        with pytest.raises(InvalidScenario, match="name: "):
            checked(source, Permissions())


PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**63) | st.floats(allow_nan=False) | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)


@given(PLAIN)
def test_a_text_gives_the_same_values_again(value: Any) -> None:
    try:
        scenario = Scenario(**BURGER, world=value)
    except InvalidScenario:
        # Texts with control characters, keys that are equal after YAML has read them, and too deep values.
        return
    again = read_document("again", scenario.to_yaml()).data
    assert isinstance(again, dict)
    assert _lists(again["world"]) == scenario.keys["world"] == _lists(value)
    assert yaml.safe_load(scenario.to_yaml())["name"] == "burger drives"


def _lists(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _lists(each) for key, each in value.items()}
    return [_lists(each) for each in value] if isinstance(value, tuple | list) else value
