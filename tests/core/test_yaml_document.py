"""Strict YAML 1.2: what each value becomes, where it stands, and what is refused."""

from __future__ import annotations

import math
import re
from collections import ChainMap
from typing import Annotated, Any, Literal

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field, ValidationError

from sim_action.core import field_types
from sim_action.core.errors import InvalidScenario, Location, Problem
from sim_action.core.yaml_document import MAX_DEPTH, MAX_VALUES, Document, KeyPath, ProblemList, read_document


def read(text: str) -> object:
    return read_document("s.yml", text).data


def problem(text: str) -> Problem:
    with pytest.raises(InvalidScenario) as raised:
        read(text)
    (found,) = raised.value.problems
    return found


def place(document: Document, *path: str | int) -> str:
    return str(document.location(path))


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("on", "on"),
        ("no", "no"),
        ("yes", "yes"),
        ("y", "y"),
        ("1:30", "1:30"),
        ("2024-01-01", "2024-01-01"),
        ("1_000", "1_000"),
        ("0b11", "0b11"),
        ("012", 12),
        ("-7", -7),
        ("+7", 7),
        ("0o17", 15),
        ("0x1F", 31),
        ("1e-3", 1e-3),
        ("1.5", 1.5),
        (".5", 0.5),
        ("-1.", -1.0),
        ("1E5", 1e5),
        ("1e999", math.inf),
        ("-.inf", -math.inf),
        ("true", True),
        ("FALSE", False),
        ("tRue", "tRue"),
        ("~", None),
        ("null", None),
        ("nULL", "nULL"),
        ("'5'", "5"),
        ('"true"', "true"),
        ("30 s", "30 s"),
        ("|\n  a\n  b\n", "a\nb\n"),
        (">\n  a\n  b\n", "a b\n"),
        ("{a: 1, b: [x, y]}", {"a": 1, "b": ("x", "y")}),
        ("a:", {"a": None}),
        ("- 1\n- - 2\n", (1, (2,))),
        ("'<<': 1", {"<<": 1}),
        ("on: 1", {"on": 1}),
        ("'1': 1", {"1": 1}),
        ("", None),
        ("# only a comment", None),
        ("\ufeffa: 1", {"a": 1}),
        ("%YAML 1.2\n---\na: 1\n...\n", {"a": 1}),
    ],
)
def test_a_value_is_what_yaml_1_2_says(text: str, value: object) -> None:
    found = read(text)
    assert found == value
    assert type(found) is type(value)


def test_nan_is_read_for_others_to_refuse() -> None:
    found = read(".nan")
    assert isinstance(found, float)
    assert math.isnan(found)


TEXT = """\
name: a
robot:
  model: b
expect:
  - travel: {at_least: 1.5 m}
  - no_collision
"""


@pytest.mark.parametrize(
    ("path", "where"),
    [
        ((), "s.yml:1:1"),
        (("name",), "s.yml:1:1"),
        (("robot",), "s.yml:2:1"),
        (("robot", "model"), "s.yml:3:3"),
        (("expect", 0), "s.yml:5:5"),
        (("expect", 0, "travel"), "s.yml:5:5"),
        (("expect", 0, "travel", "at_least"), "s.yml:5:14"),
        (("expect", 1), "s.yml:6:5"),
        (("expect", 0, "travel", "absent", "deeper"), "s.yml:5:5"),
        (("expect", 7), "s.yml:4:1"),
        (("absent",), "s.yml:1:1"),
    ],
)
def test_every_key_and_entry_has_its_place(path: KeyPath, where: str) -> None:
    assert place(read_document("s.yml", TEXT), *path) == where


@pytest.mark.parametrize("end", ["\r\n", "\r"])
def test_lines_are_counted_whatever_ends_them(end: str) -> None:
    document = read_document("s.yml", TEXT.replace("\n", end))
    assert place(document, "robot", "model") == "s.yml:3:3"


def test_lines_below_an_alias_and_duplicates_have_their_places() -> None:
    document = read_document("s.yml", "a: &x {b: 1}\nc: *x\n")
    assert document.data == {"a": {"b": 1}, "c": {"b": 1}}
    assert place(document, "c", "b") == "s.yml:2:1"
    with pytest.raises(InvalidScenario) as raised:
        read("a: 1\na: 2\nb: {c: 1, c: 2}\n")
    assert [str(found.location) for found in raised.value.problems] == ["s.yml:2:1", "s.yml:3:11"]
    assert read("[" * MAX_DEPTH + "]" * MAX_DEPTH)


@pytest.mark.parametrize(
    ("text", "where", "message"),
    [
        ("a: 1\nb: 2\na: 3\n", "3:1", "the key 'a' is used twice"),
        ("a: {b: 1, b: 2}", "1:11", "the key 'b' is used twice"),
        ("a: 1\n'a': 2\n", "2:1", "the key 'a' is used twice"),
        ("a: [b\nc: d\n", "2:2", "not valid YAML: while parsing a flow sequence expected ',' or ']', but got ':'"),
        ("a: 'b\n", "2:1", "not valid YAML: while scanning a quoted scalar found unexpected end of stream"),
        ("a:\n\t- b\n", "2:1", "not valid YAML: while scanning for the next token found character '\\t' that cannot"),
        ("a: b: c\n", "1:5", "not valid YAML: mapping values are not allowed here"),
        ("name: @x\n", "1:7", "not valid YAML: while scanning for the next token found character '@' that cannot"),
        ("a: 1\nb: \x1b[31m\n", "2:4", "the control character U+001B is not allowed; remove it"),
        ("a: \x00", "1:4", "the control character U+0000 is not allowed; remove it"),
        ('a: 1\nb: "\\ud800"\n', "2:4", "half of a surrogate pair is not a character"),
        ('a: 1\nb: "\\UFFFFFFFF"\n', "2:2", "not valid YAML: an escape or a number after this place is out of range"),
        ("%YAML 1." + "9" * 5000 + "\n---\na: 1\n", "1:1", "not valid YAML"),
        ("a: 1\n---\nb: 2\n", "2:1", "found a second YAML document; a file holds one scenario"),
        ("a: !!python/object:os.system b", "1:4", "the tag '!!python/object:os.system' is not supported; remove it"),
        ("a: !!str 5", "1:4", "the tag '!!str' is not supported; remove it"),
        ("a: !mine [1]", "1:4", "the tag '!mine' is not supported; remove it"),
        ("a: *nowhere", "1:4", "the alias '*nowhere' has no anchor before it"),
        ("a: &x [*x]", "1:8", "the alias '*x' has no anchor before it"),
        ("1: a", "1:1", "a key must be text; put it in quotes: '1'"),
        ("true: a", "1:1", "a key must be text; put it in quotes: 'true'"),
        ("? [a]\n: b", "1:3", "a key must be text; this is a map, a list or an alias"),
        ("a: &x b\n*x : c", "2:1", "a key must be text; this is a map, a list or an alias"),
        ("a: " + "9" * 401, "1:4", "a number of 401 digits; the maximum is 400"),
        ("a: 0x" + "f" * 9000, "1:4", "a number of 9002 digits; the maximum is 400"),
        ('"a\\n::error::b": 1\n"a\\n::error::b": 2', "2:1", "the key 'a\\n::error::b' is used twice"),
    ],
)
def test_what_is_refused_is_told_with_its_place(text: str, where: str, message: str) -> None:
    found = problem(text)
    assert str(found.location) == f"s.yml:{where}"
    assert message in found.message
    assert found.message.isprintable()


@pytest.mark.parametrize("text", ["[" * 20_000 + "]" * 20_000, "{a: " * 20_000, "- " * 20_000])
def test_nesting_has_a_limit(text: str) -> None:
    assert problem(text).message == f"more than {MAX_DEPTH} nested maps and lists"


def test_aliases_and_values_have_a_limit() -> None:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, 30)]
    message = problem("\n".join(lines)).message
    assert message.startswith("a4.")
    assert f": more than {MAX_VALUES} values in this file;" in message
    assert message.endswith("each alias as a copy of its anchor")
    assert problem("- 1\n" * (MAX_VALUES + 1)).message.startswith(f"{MAX_VALUES - 1}: more than {MAX_VALUES} values in")
    # An object is two maps, a list and five values; the file, `world` and `objects` are three more.
    objects = "".join(f"    - {{name: b{n}, box: [1, 1, 1], pose: {{x: 1}}}}\n" for n in range(3000))
    message = problem(f"world:\n  objects:\n{objects}").message
    assert message.startswith(f"world.objects.{(MAX_VALUES - 3) // 8}.")


plain = st.none() | st.booleans() | st.integers(-(10**6), 10**6) | st.floats(allow_nan=False) | st.text(max_size=20)
keys = st.text(st.characters(exclude_categories=["Cs", "Cc"]), max_size=8)
structures = st.recursive(
    plain, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(keys, inner, max_size=3), max_leaves=10
)


def as_read(value: object) -> object:
    if isinstance(value, list):
        return tuple(as_read(entry) for entry in value)
    return {key: as_read(entry) for key, entry in value.items()} if isinstance(value, dict) else value


@given(structures)
def test_what_is_dumped_as_yaml_is_read_back(value: object) -> None:
    # With strings in quotes, 1.1 and 1.2 agree; PyYAML writes exponents only with a dot.
    text = yaml.dump(value, Dumper=_Quoting, allow_unicode=True)
    assert read(text) == as_read(value)


class _Quoting(yaml.SafeDumper):
    def ignore_aliases(self, data: object) -> bool:
        return True


def _quoted(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style='"')


_Quoting.add_representer(str, _quoted)


@given(st.text(max_size=200))
def test_any_text_is_read_or_refused_with_a_place_in_it(text: str) -> None:
    try:
        read(text)
    except InvalidScenario as error:
        lines = re.split("\r\n|[\r\n\x85\u2028\u2029]", text)
        for found in error.problems:
            line, column = found.location.line, found.location.column
            assert line is not None
            assert column is not None
            assert 1 <= line <= len(lines)
            assert 1 <= column <= len(lines[line - 1]) + 1


def test_the_files_are_those_of_all_places() -> None:
    own: dict[KeyPath, Location] = {("a",): Location("a.sim.yml", 1)}
    inherited: dict[KeyPath, Location] = {("b",): Location("base.yml", 2)}
    assert Document("a.sim.yml", {}, own).files == {"a.sim.yml"}
    assert Document("a.sim.yml", {}, ChainMap(own, inherited)).files == {"a.sim.yml", "base.yml"}


ERRORS = "name: a\nrobot:\n  model: b\nexpect: []\n"


def problems() -> ProblemList:
    return ProblemList(read_document("a.sim.yml", ERRORS))


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
    found = problems()
    found.note(("robot", "model"), "is not there")
    assert found.has_below(("robot",))
    assert not found.has_below(("robot", "model"))
    assert not found.has_below(("expect",))


class Inner(field_types.FrozenModel):
    size: field_types.PositiveMetres = 1.0
    for_: Annotated[field_types.NonNegativeSeconds, Field(alias="for")] = 1.0
    turn: Annotated[field_types.PositiveRadians, Field(le=math.radians(170))] = 1.0
    words: tuple[str, ...] = ()


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
        ({"inner": {"zzz": 1}}, "inner.zzz", "unknown key (allowed: for, size, turn, words)"),
        ({"inner": {"for_": 1}}, "inner.for_", "unknown key; did you mean 'for'? (allowed: for, size, turn, words)"),
        (
            {"many": ({}, {"siz": 1})},
            "many.1.siz",
            "unknown key; did you mean 'size'? (allowed: for, size, turn, words)",
        ),
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
        ({"inner": {"turn": "180 deg"}}, "inner.turn", "must be at most 170 deg, found '180 deg'"),
        ({"inner": {"words": "a"}}, "inner.words", "expected a list, found 'a'; write [a]"),
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


def test_missing_keys_and_bad_keys_of_maps_are_named() -> None:
    with pytest.raises(ValidationError) as raised:
        Spec.model_validate({})
    assert list(field_types.spec_errors(Spec, {}, raised.value)) == [(("name",), "the key 'name' is missing")]

    class Named(field_types.FrozenModel):
        places: dict[Annotated[str, Field(max_length=3)], float]

    data = {"places": {"kitchen": 1.0}}
    with pytest.raises(ValidationError) as caught:
        Named.model_validate(data)
    assert list(field_types.spec_errors(Named, data, caught.value)) == [
        (("places", "kitchen"), "must have at most 3 characters")
    ]
