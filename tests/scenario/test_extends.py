"""How one document stands on another: what counts, and where each value is from."""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.yaml_document import Document, KeyPath, read_document
from sim_action.scenario.extends import entries_of, merged, without

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
    return merged(read_document("base.yml", BASE), read_document("over.yml", text))


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
    both = merged(Document("b", below), Document("a", above)).data
    assert merged(Document("x", both), Document("a", above)).data == both
    assert merged(Document("b", {}), Document("a", above)).data == above
    assert merged(Document("b", below), Document("a", {})).data == below
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
    first, second = entries_of(read_document("base.yml", text), "list")
    assert (first.data, second.data) == ({"b": 2}, {"c": (3,)})
    assert place(first, "b") == "base.yml:3:6"
    assert (place(second), place(second, "c", 0), place(second, "a")) == (
        "base.yml:4:5",
        "base.yml:4:9",
        "base.yml:4:5",
    )


def test_keys_that_are_left_out_are_gone() -> None:
    document = without(read_document("base.yml", BASE), "expect", "absent")
    assert isinstance(document.data, dict)
    assert set(document.data) == {"robot", "time_limit"}
    assert place(document, "expect", 0) == "base.yml:1:1"
    assert place(document, "time_limit") == "base.yml:7:1"
