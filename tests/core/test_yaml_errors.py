"""Problems of one file are collected: each once, those of the file first, in the order of its lines."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import pytest
from pydantic import Field, ValidationError

from sim_action.core import field_types
from sim_action.core.errors import Location, Problem
from sim_action.core.yaml_document import read_document
from sim_action.core.yaml_errors import ProblemList

TEXT = "name: a\nrobot:\n  model: b\nexpect: []\n"


def problems() -> ProblemList:
    return ProblemList(read_document("a.sim.yml", TEXT))


def test_each_is_told_once_and_in_the_order_of_lines() -> None:
    found = problems()
    found.note_elsewhere(Problem(Location("b.urdf", 1), "broken"))
    found.note(("expect",), "is empty")
    found.note_all(("robot",), iter([(("model",), "is not there"), (("model",), "is not there")]))
    assert [str(problem) for problem in found.error().problems] == [
        "a.sim.yml:3:3: robot.model: is not there",
        "a.sim.yml:4:1: expect: is empty",
        "b.urdf:1: broken",
    ]


def test_what_is_wrong_further_down_is_known() -> None:
    found = problems()
    found.note(("robot", "model"), "is not there")
    assert found.has_below(("robot",))
    assert not found.has_below(("robot", "model"))
    assert not found.has_below(("expect",))


class Inner(field_types.FrozenModel):
    size: field_types.PositiveMetres = 1.0
    for_: Annotated[field_types.NonNegativeSeconds, Field(alias="for")] = 1.0


class Spec(field_types.FrozenModel):
    name: field_types.Name
    kind: Literal["big", "small"] = "big"
    inner: Inner | None = None
    many: tuple[Inner, ...] = ()
    pair: tuple[field_types.PositiveMetres, field_types.PositiveMetres] | None = None
    named: dict[str, field_types.PositiveMetres] = {}  # noqa: RUF012 - pydantic copies it
    count: Annotated[int, Field(ge=1, le=9)] = 1
    angle: Annotated[field_types.PositiveRadians, Field(le=math.radians(170))] = 1.0
    near: Annotated[field_types.Metres, Field(ge=0.001, lt=10_000)] = 1.0
    flag: bool = False
    some: Annotated[tuple[str, ...], Field(min_length=1)] = ("a",)
    path: Annotated[tuple[int, ...], Field(min_length=2)] = (1, 2)
    word: Annotated[str, Field(min_length=3)] = "abc"
    table: tuple[tuple[str, str], ...] = ()


def findings(**data: Any) -> list[tuple[str, str]]:
    with pytest.raises(ValidationError) as raised:
        Spec.model_validate(written := {"name": "a", **data})
    return [
        (".".join(map(str, path)), message) for path, message in field_types.spec_errors(Spec, written, raised.value)
    ]


ALLOWED = "(allowed: angle, count, flag, inner, kind, many, name, named, near, pair, path, some, table, word)"


@pytest.mark.parametrize(
    ("data", "path", "message"),
    [
        ({"nmae": 1}, "nmae", f"unknown key; did you mean 'name'? {ALLOWED}"),
        ({"inner": {"zzz": 1}}, "inner.zzz", "unknown key (allowed: for, size)"),
        ({"inner": {"for_": 1}}, "inner.for_", "unknown key; did you mean 'for'? (allowed: for, size)"),
        ({"many": ({}, {"siz": 1})}, "many.1.siz", "unknown key; did you mean 'size'? (allowed: for, size)"),
        ({"kind": "tiny"}, "kind", "expected 'big' or 'small', found 'tiny'"),
        ({"name": 5}, "name", "expected text, found 5; put it in quotes"),
        ({"name": True}, "name", "expected text, found true; put it in quotes"),
        ({"name": None}, "name", "expected text, found nothing"),
        ({"name": {}}, "name", "expected text, found a map of keys"),
        ({"name": ""}, "name", "must not be empty"),
        ({"name": "x" * 121}, "name", "must have at most 120 characters"),
        ({"some": ()}, "some", "must not be empty"),
        ({"path": (1,)}, "path", "expected a list of at least 2, found a list of 1"),
        ({"path": ()}, "path", "expected a list of at least 2, found an empty list"),
        ({"word": "ab"}, "word", "must have at least 3 characters, found 'ab'"),
        ({"table": ("a",)}, "table.0", "expected a list, found 'a'"),
        ({"some": "a"}, "some", "expected a list, found 'a'; write [a]"),
        ({"some": "a, b"}, "some", "expected a list, found 'a, b'"),
        ({"pair": "a"}, "pair", "expected a list, found 'a'"),
        ({"some": {"a": 1}}, "some", "expected a list, found a map of keys; begin each entry of a list with '- '"),
        ({"inner": "x"}, "inner", "expected a map of keys, found 'x'"),
        ({"inner": (1, 2)}, "inner", "expected a map of keys, found a list of 2"),
        ({"inner": {"size": 0}}, "inner.size", "must be greater than 0, found 0"),
        ({"inner": {"size": "-1 cm"}}, "inner.size", "must be greater than 0, found '-1 cm'"),
        ({"count": 0}, "count", "must be at least 1, found 0"),
        ({"count": 10}, "count", "must be at most 9, found 10"),
        ({"angle": "180 deg"}, "angle", "must be at most 170 deg, found '180 deg'"),
        ({"near": 0}, "near", "must be at least 0.001 m, found 0"),
        ({"near": "10 km"}, "near", "must be less than 10,000 m, found '10 km'"),
        ({"count": "1"}, "count", "expected a whole number, found '1'"),
        ({"flag": "on"}, "flag", "expected true or false, found 'on'"),
        ({"pair": (1,)}, "pair.1", "entry 2 of the list is missing"),
        ({"pair": (1, 2, 3)}, "pair", "expected a list of at most 2, found a list of 3"),
        ({"named": {"a.b": "1 s"}}, "named.a.b", "'s' is not a unit of length; use one of: m, mm, cm, km"),
        ({"named": ("a",)}, "named", "expected a map of keys, found a list of 1"),
    ],
)
def test_a_finding_is_a_sentence_at_a_path(data: dict[str, Any], path: str, message: str) -> None:
    assert findings(**data) == [(path, message)]


def test_a_missing_key_is_named() -> None:
    with pytest.raises(ValidationError) as raised:
        Spec.model_validate({})
    assert list(field_types.spec_errors(Spec, {}, raised.value)) == [(("name",), "the key 'name' is missing")]


class Deep(field_types.FrozenModel):
    angle: Annotated[field_types.PositiveRadians, Field(le=math.radians(170))] = 1.0
    some: tuple[str, ...] = ()


class Outer(field_types.FrozenModel):
    deep: Deep


@pytest.mark.parametrize(
    ("data", "path", "message"),
    [
        ({"angle": "180 deg"}, ("deep", "angle"), "must be at most 170 deg, found '180 deg'"),
        ({"some": "a"}, ("deep", "some"), "expected a list, found 'a'; write [a]"),
    ],
)
def test_units_and_hints_are_those_of_the_innermost_key(
    data: dict[str, Any], path: tuple[str, ...], message: str
) -> None:
    with pytest.raises(ValidationError) as raised:
        Outer.model_validate({"deep": data})
    assert list(field_types.spec_errors(Outer, {"deep": data}, raised.value)) == [(path, message)]


def test_a_bad_key_of_a_map_is_told_at_the_key() -> None:
    class Named(field_types.FrozenModel):
        places: dict[Annotated[str, Field(max_length=3)], float]

    data = {"places": {"kitchen": 1.0}}
    with pytest.raises(ValidationError) as caught:
        Named.model_validate(data)

    assert list(field_types.spec_errors(Named, data, caught.value)) == [
        (("places", "kitchen"), "must have at most 3 characters")
    ]
