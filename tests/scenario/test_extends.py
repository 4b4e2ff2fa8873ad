"""How one document stands on another: what counts, and where each value is from."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel

from sim_action.assertions import ASSERTIONS
from sim_action.commands import COMMANDS
from sim_action.core.yaml_document import Document, KeyPath, read_document
from sim_action.robot.model.robot_spec import Robot
from sim_action.scenario.extends import file_keys, seen_from


def moved(folder: Path, data: dict[str, Any]) -> object:
    own = folder / "lib"
    own.mkdir(exist_ok=True)
    (own / "drive.py").touch()
    return seen_from(folder / "suite", Document("s.yml", data), own).data


@pytest.mark.parametrize(
    ("name", "seen"),
    [
        ("r.urdf", "../lib/r.urdf"),
        ("../r.urdf", "../r.urdf"),
        ("../suite/r.urdf", "r.urdf"),
        ("turtlebot3_burger", "turtlebot3_burger"),
        ("package://a/b.urdf", "package://a/b.urdf"),
        ("/opt/r.urdf", "/opt/r.urdf"),
        ("misspelt", "misspelt"),
    ],
)
def test_a_model_is_the_same_file_from_elsewhere(name: str, seen: str, tmp_path: Path) -> None:
    assert moved(tmp_path, {"robot": {"model": name}}) == {"robot": {"model": seen}}


def test_the_words_of_a_process_are_files_if_there_are_such_files(tmp_path: Path) -> None:
    words = ("python3", "drive.py", "./drive.py", "1.5", "--out=a.b", "x" * 5000)
    expected = ("python3", "../lib/drive.py", "../lib/drive.py", "1.5", "--out=a.b", "x" * 5000)
    assert moved(tmp_path, {"commands": {"process": words}}) == {"commands": {"process": expected}}
    assert moved(tmp_path, {"commands": ({"process": words},)}) == {"commands": ({"process": expected},)}
    text = moved(tmp_path, {"commands": {"process": "./drive.py 'a b'"}})
    assert text == {"commands": {"process": ("../lib/drive.py", "a b")}}
    assert moved(tmp_path, {"commands": {"process": "'"}}) == {"commands": {"process": "'"}}


def test_surfaces_and_maps_are_the_same_files(tmp_path: Path) -> None:
    def world(folder: str) -> dict[str, Any]:
        shapes = ({"mesh": {"file": f"{folder}a.stl"}}, {"heightfield": {"image": f"{folder}b.png", "size": (1, 1)}})
        return {"world": {"objects": (*shapes, {"name": "m", "map": {"file": f"{folder}c.yaml"}})}}

    assert moved(tmp_path, world("")) == world("../lib/")


def test_a_class_of_the_users_is_found_however_deep_it_stands(tmp_path: Path) -> None:
    def expect(file: str) -> dict[str, Any]:
        alone = {"assertion": f"{file}:Level"}
        whole = {"assertion": {"class": f"{file}:Level", "with": {"file": "c.py"}}}
        return {"expect": ("upright", alone, {"not": whole}, {"any_of": (alone, {"all_of": (whole,)})})}

    assert moved(tmp_path, expect("a/c.py")) == expect("../lib/a/c.py")


def test_files_that_vary_are_the_same_files(tmp_path: Path) -> None:
    def variations(folder: str) -> dict[str, Any]:
        return {
            "robot.model": (f"{folder}r.urdf", "turtlebot3_burger"),
            "world.objects.rock.mesh.file": (f"{folder}a.stl", 3),
            "world.objects": (({"name": "rock", "mesh": {"file": f"{folder}a.stl"}},), ()),
            "expect.0.not.assertion": (f"{folder}c.py:Level",),
            "commands.0.process.1": (f"{folder}drive.py", "1.5"),
            "robot.pose.x": {"uniform": (0, 1), "samples": 3},
            "robot.pose.y": {"csv": f"{folder}rows.csv", "column": "y"},
            "robot.srdf": {"choice": (f"{folder}a.srdf", f"{folder}b.srdf"), "samples": 3},
            "robot.pose.z": {"csv": 3, "choice": 4},
            "name": "a.b",
        }

    assert moved(tmp_path, {"variations": variations("")}) == {"variations": variations("../lib/")}


@pytest.mark.parametrize("data", [{"commands": 7}, {"commands": ({"script": ("a.py",)},)}, {"robot": None}, {}])
def test_what_is_no_name_stays_what_it_is(data: dict[str, Any], tmp_path: Path) -> None:
    assert moved(tmp_path, data) == data


def test_each_key_whose_description_speaks_of_a_path_or_a_folder_is_known() -> None:
    """A new key that names files is told of here: annotate it with NamesFile."""
    keys = (*file_keys(), *file_keys(if_there=True))
    names = {"path"} | {pattern[-1] for pattern in keys} | {pattern[-2] for pattern in keys}
    models: list[type[BaseModel]] = [Robot, *(table.load(name) for table in (COMMANDS, ASSERTIONS) for name in table)]
    for model in models:
        for name, field in model.model_fields.items():
            if re.search(r"\b(path of|folders? of|the program|FILE)\b", field.description or ""):
                assert name in names, (model, name)


BASE = """\
robot:
  model: burger
  joints: {a: 1, b: 2}
expect:
  - travel
  - upright
time_limit: 30
"""

KEYS = st.sampled_from("abcd")
MAPS = st.recursive(
    st.integers(0, 9), lambda values: st.dictionaries(KEYS, values) | st.lists(values).map(tuple), max_leaves=8
)


def over(text: str) -> Document:
    return read_document("base.yml", BASE).merged(read_document("over.yml", text))


def place(document: Document, *path: str | int) -> str:
    return str(document.location(path))


def test_maps_merge_and_each_value_keeps_its_place() -> None:
    document = over("robot:\n  joints: {b: 3}\nname: x\n")
    assert document.data == {
        "robot": {"model": "burger", "joints": {"a": 1, "b": 3}},
        "expect": ("travel", "upright"),
        "time_limit": 30,
        "name": "x",
    }
    assert place(document, "robot", "joints", "a") == "base.yml:3:12"
    assert place(document, "robot", "joints", "b") == "over.yml:2:12"
    assert place(document, "robot", "drive") == "over.yml:1:1"
    assert place(document, "expect", 1) == "base.yml:6:5"
    assert place(document, "commands") == "over.yml:1:1"
    assert document.file == "over.yml"


def test_lists_and_scalars_replace() -> None:
    document = over("expect:\n  - no_collision\nrobot: none\ntime_limit: {a: 1}\n")
    assert document.data == {"robot": "none", "expect": ("no_collision",), "time_limit": {"a": 1}}
    # What is gone has no place any more.
    assert place(document, "expect", 1) == "over.yml:1:1"
    assert place(document, "robot", "model") == "over.yml:3:1"


def test_null_takes_a_key_out_and_is_itself_where_there_is_none() -> None:
    document = over("expect: null\nrobot: {joints: ~, base: null}\n")
    assert document.data == {"robot": {"model": "burger", "base": None}, "time_limit": 30}
    assert place(document, "expect") == "over.yml:1:1"
    assert place(document, "robot", "joints", "a") == "over.yml:2:9"


@given(st.dictionaries(KEYS, MAPS), st.dictionaries(KEYS, MAPS))
def test_the_file_above_has_the_last_word(below: dict[str, Any], above: dict[str, Any]) -> None:
    both = Document("b", below).merged(Document("a", above)).data
    assert Document("x", both).merged(Document("a", above)).data == both
    assert Document("b", {}).merged(Document("a", above)).data == above
    assert Document("b", below).merged(Document("a", {})).data == below
    for path, value in leaves(above):
        assert at(both, path) == value


def leaves(data: Any, path: KeyPath = ()) -> list[tuple[KeyPath, Any]]:
    if isinstance(data, dict):
        return [leaf for key, value in data.items() for leaf in leaves(value, (*path, key))]
    return [(path, data)]


def at(data: Any, path: KeyPath) -> Any:
    for step in path:
        data = data[step]
    return data


def test_an_entry_is_a_document_with_the_places_of_its_own() -> None:
    text = "a: 1\nlist:\n  - {b: 2}\n  - c: [3]\n"
    first, second = read_document("base.yml", text).entries("list")
    assert (first.data, second.data) == ({"b": 2}, {"c": (3,)})
    assert place(first, "b") == "base.yml:3:6"
    places = [place(second, *path) for path in ((), ("c", 0), ("a",))]
    assert places == ["base.yml:4:5", "base.yml:4:9", "base.yml:4:5"]


def test_keys_that_are_left_out_are_gone() -> None:
    document = read_document("base.yml", BASE).without("expect", "absent")
    assert isinstance(document.data, dict)
    assert set(document.data) == {"robot", "time_limit"}
    assert place(document, "expect", 0) == "base.yml:1:1"
    assert place(document, "time_limit") == "base.yml:7:1"
