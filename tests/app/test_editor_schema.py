"""The form of schemas that editors need: alternatives told apart, partial maps, bounds and patterns."""

from __future__ import annotations

from typing import Any

import jsonschema
import pytest

from sim_action.app.editor_schema import DIALECT, EditorSchemas, chosen_by_key

QUANTITY: dict[str, Any] = {
    "anyOf": [
        {"type": "number", "exclusiveMinimum": 0},
        {
            "type": "string",
            "pattern": r"(?!)number, or text such as 20 m|^ *[-+]?([0-9]+) *(m|mm)?[ \n]*$",
            "examples": ["20 m"],
            "description": "number, or text such as 20 m; units: m, mm",
        },
    ]
}
WHEEL: dict[str, Any] = {
    "type": "object",
    "description": "A wheel.",
    "properties": {"radius": QUANTITY, "tags": {"type": "array", "items": {"$ref": "#/$defs/Tag"}}},
    "required": ["radius"],
    "additionalProperties": False,
}
TAG: dict[str, Any] = {
    "type": "object",
    "properties": {"text": {"type": "string"}},
    "required": ["text"],
    "additionalProperties": False,
}


def editor(root: dict[str, Any], *, is_partial: bool = False) -> dict[str, Any]:
    schemas = EditorSchemas({"Wheel": WHEEL, "Tag": TAG, "Unused": {"type": "string"}})
    found = schemas.document({"title": "t"}, schemas.partial(root) if is_partial else root)
    jsonschema.Draft7Validator.check_schema(found)
    assert found["$schema"] == DIALECT
    return found


def messages(schema: dict[str, Any], value: object) -> list[str]:
    return [error.message for error in jsonschema.Draft7Validator(schema).iter_errors(value)]


def test_definitions_have_one_meaning_and_are_kept_if_referred_to() -> None:
    schema = editor({"$ref": "#/$defs/Wheel"})
    assert sorted(schema["definitions"]) == ["Quantity_m_mm_exclusiveMinimum_0", "Tag", "Wheel"]
    schemas = EditorSchemas({"Tag": TAG})
    assert schemas.define("Tag", TAG) == {"$ref": "#/$defs/Tag"}
    with pytest.raises(ValueError, match="two definitions have the name Tag"):
        schemas.define("Tag", WHEEL)


@pytest.mark.parametrize(
    ("value", "problem"),
    [
        (1, ""),
        ("1 mm", ""),
        (0, "0 is less than or equal to the minimum of 0"),
        ("-1 mm", "number, or text such as 20 m"),
        ("1 kg", "number, or text such as 20 m"),
        (True, "True is not of type 'number'"),
        (None, "None is not of type 'number'"),
    ],
)
def test_a_quantity_has_one_problem(value: object, problem: str) -> None:
    found = messages(editor({"$ref": "#/$defs/Wheel"}), {"radius": value})
    assert [problem in message for message in found] == ([True] if problem else [])


def test_an_optional_quantity_may_be_null_and_has_one_problem() -> None:
    schema = editor({"type": "object", "properties": {"x": {"anyOf": [*QUANTITY["anyOf"], {"type": "null"}]}}})
    assert messages(schema, {"x": None}) == messages(schema, {"x": "2 m"}) == []
    (problem,) = messages(schema, {"x": "2 kg"})
    assert "number, or text such as 20 m" in problem


@pytest.mark.parametrize(("words", "value"), [({"ge": 5, "lt": 7}, 6), ({"minimum": 5, "exclusiveMaximum": 7}, 5)])
def test_bounds_outside_of_the_alternatives_are_those_of_its_numbers(words: dict[str, int], value: int) -> None:
    schema = editor({"type": "object", "properties": {"x": {**QUANTITY, **words}}})
    assert messages(schema, {"x": value}) == messages(schema, {"x": "2 m"}) == []
    assert (
        len(messages(schema, {"x": 4})) == len(messages(schema, {"x": 7})) == len(messages(schema, {"x": "0 m"})) == 1
    )


def test_a_description_names_the_units_and_the_default() -> None:
    properties = {
        "x": {**QUANTITY, "description": "a length", "default": 1.5},
        "on": {"type": "boolean", "default": True},
    }
    found = editor({"type": "object", "properties": properties})["properties"]
    assert found["x"]["description"] == "a length\n\nnumber, or text such as 20 m; units: m, mm\n\ndefault: 1.5"
    assert found["on"]["description"] == "default: true"


def test_alternatives_are_told_apart_by_their_types() -> None:
    branches = [{"$ref": "#/$defs/Tag"}, {"enum": ["a", "b"]}, {"type": "array", "items": {"type": "integer"}}]
    schema = editor({"anyOf": branches})
    for value in ({"text": "t"}, "a", [1, 2]):
        assert messages(schema, value) == []
    assert messages(schema, "c") == ["'c' is not one of ['a', 'b']"]
    assert messages(schema, ["x"]) == ["'x' is not of type 'integer'"]
    assert messages(schema, {"txt": "t", "text": "t"}) == [
        "Additional properties are not allowed ('txt' was unexpected)"
    ]
    assert messages(schema, 5) == ["5 is not of type 'object'"]
    schema = editor({"type": ["integer", "null"]})
    assert messages(schema, 1) == messages(schema, None) == []
    assert "type" not in schema


def test_a_map_of_one_kind_reports_the_second_and_a_missing_one() -> None:
    kinds = {"a": {"type": "integer"}, "b": {"type": "integer"}}
    one = [{"required": [kind]} for kind in kinds]
    schema = editor({"type": "object", "properties": {**kinds, "name": {"type": "string"}}, "oneOf": one})
    assert messages(schema, {"a": 1, "name": "n"}) == []
    assert messages(schema, {"name": "n"}) == ["'a' is a required property"]
    assert len(messages(schema, {"a": 1, "b": 1})) == 2
    without_options = editor({"type": "object", "properties": kinds, "oneOf": one})
    assert len(messages(without_options, {})) == 1


def test_maps_are_told_apart_by_a_key() -> None:
    tag, wheel = ({"type": "object", "properties": {key: {}}, "required": [key, "x"]} for key in ("tag", "wheel"))
    schema = editor(chosen_by_key({"tag": tag, "wheel": wheel}, {"tag": {}, "wheel": {}, "x": {"description": "d"}}))
    assert messages(schema, {"wheel": 1, "x": 1}) == []
    assert messages(schema, {"wheel": 1}) == ["'x' is a required property"]
    assert messages(schema, {"x": 1}) == ["'tag' is a required property"]
    assert messages(schema, {"whel": 1}) == ["Additional properties are not allowed ('whel' was unexpected)"]


def test_a_partial_map_needs_no_key_and_null_removes_one_but_lists_are_whole() -> None:
    schema = editor({"type": "object", "properties": {"wheel": {"$ref": "#/$defs/Wheel"}}}, is_partial=True)
    accepted: list[dict[str, Any]] = [{}, {"wheel": None}, {"wheel": {}}, {"wheel": {"radius": None}}]
    for value in (*accepted, {"wheel": {"tags": [{"text": "t"}]}}):
        assert messages(schema, value) == []
    assert messages(schema, {"wheel": {"raduis": 1}})
    assert messages(schema, {"wheel": {"radius": 0}})
    assert messages(schema, {"wheel": {"tags": [{}]}})
    assert messages(schema, {"wheel": {"tags": [None]}})


def test_patterns_end_at_the_end() -> None:
    schema = editor({"type": "string", "pattern": "^a$"})
    assert [bool(messages(schema, text)) for text in ("a", "a\n", "ab")] == [False, True, True]
