"""Field types: quantities with units, bounds, names; and the frozen base of all specs."""

from __future__ import annotations

import math
import pickle
import re
from typing import Annotated, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field, TypeAdapter, ValidationError, model_validator

from sim_action.core import field_types, units
from sim_action.core.errors import InvalidPart, InvalidScenario
from sim_action.core.field_types import (
    FrozenModel,
    JointPosition,
    Metres,
    Name,
    PositiveHertz,
    PositiveMetres,
    PositiveRadians,
    PositiveSeconds,
    Quantity,
    Ratio,
    Title,
    bound_text,
    bounds_text,
    pattern_at_least,
    unit_of,
)


class Spec(FrozenModel):
    name: Name = "spec"
    title: Title = "spec"
    limit: PositiveSeconds = 1.0
    x: Metres | None = None


def messages(**data: Any) -> list[str]:
    with pytest.raises(ValidationError) as raised:
        Spec.model_validate(data)
    return [error["msg"] for error in raised.value.errors()]


def test_a_program_gets_sentences_and_their_problems() -> None:
    with pytest.raises(InvalidScenario) as raised:
        Spec(limit=-1, limits=2)  # type: ignore[call-arg]
    assert [(each.location.file, each.message) for each in raised.value.problems] == [
        ("Spec (Python)", "limit: must be greater than 0, found -1"),
        ("Spec (Python)", "limits: unknown key; did you mean 'limit'? (allowed: limit, name, title, x)"),
    ]
    assert raised.value.__context__ is None
    copy = pickle.loads(pickle.dumps(raised.value))
    assert (type(copy), copy.problems) == (InvalidPart, raised.value.problems)


def test_a_validator_may_build_a_part() -> None:
    class Whole(FrozenModel):
        spec: Spec

        @model_validator(mode="before")
        @classmethod
        def _read(cls, data: Any) -> Any:
            return {"spec": Spec(**data)}

    with pytest.raises(ValidationError, match="limit: must be greater than 0, found -1"):
        Whole.model_validate({"limit": -1})


def test_a_quantity_is_a_float_in_si_and_a_spec_is_frozen() -> None:
    assert Spec.model_validate({"limit": "2 min", "x": "3 cm"}) == Spec(limit=120.0, x=0.03)
    assert Spec.model_validate({"limit": 3}).limit == 3.0
    assert messages(limit="{x}") == ["expected time such as '1 s', found '{x}'"]
    assert messages(limits=1) == ["Extra inputs are not permitted"]
    with pytest.raises(ValidationError, match="frozen"):
        Spec().limit = 2.0  # type: ignore[misc]  # frozen: that is the test


@pytest.mark.parametrize("name", ["burger", "drives 1.5 m, straight!", "a-b_c: (d) [e] {f} & g % h", "é 機", "a" * 120])
def test_plain_text_is_a_name(name: str) -> None:
    assert Spec(name=name).name == name


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("a\nb", "has a control character"),
        ("a\rb", "has a control character"),
        ("a\x00", "has a control character"),
        ("\x1b[31m", "has a control character"),
        ("a\u2028b", "has a control character"),
        ("\u202eabc", "has a control character"),
        (" a", "a space at its beginning or end"),
        ("a ", "a space at its beginning or end"),
        ("a|b", "contains '|'"),
        ("a<b", "contains '<'"),
        ("a>b", "contains '>'"),
        ("a`b", "contains '`'"),
        ("::error::a", "contains '::'"),
        ("##[error]a", "contains '##['"),
        ("${{ a }}", "contains '${{'"),
    ],
)
def test_what_would_act_in_a_report_is_no_name(name: str, found: str) -> None:
    (message,) = messages(name=name)
    assert "a name is one line of plain text" in message
    assert repr(name) in message
    assert found in message


@pytest.mark.parametrize("name", ["gap < 1 m", "a | b", "x > 2 && y < 3", "`travel` <b>", "a \\ b #1 @x $y *z* [w]"])
def test_the_name_of_a_scenario_may_hold_what_reports_escape(name: str) -> None:
    assert Spec(title=name).title == name


@pytest.mark.parametrize(
    "name", ["a\nb", "a\x00", " a", "a ", "::error::a", "##[error]a", "${{ a }}", "a ]]> b", "", "a" * 121]
)
def test_the_name_of_a_scenario_is_one_line_without_commands(name: str) -> None:
    assert len(messages(title=name)) == 1


@given(st.text())
def test_a_name_that_is_accepted_is_one_printable_line(name: str) -> None:
    try:
        accepted = Spec(name=name).name
    except InvalidPart:
        return
    assert accepted == name
    assert accepted.isprintable()
    assert not set(accepted) & set("|<>`")


def text_schema(kind: Any) -> dict[str, Any]:
    (found,) = (branch for branch in TypeAdapter(kind).json_schema()["anyOf"] if branch["type"] == "string")
    assert isinstance(found, dict)
    return found


def is_read(text: str, dimensions: tuple[units.Dimension, ...]) -> bool:
    try:
        units.parse(text, *dimensions)
    except units.UnitError:
        return False
    return True


DIMENSIONS = [value for value in vars(units).values() if isinstance(value, units.Dimension) and value.si]
SYMBOLS = sorted({symbol for dimension in DIMENSIONS for symbol in dimension.factors if symbol})
PIECES = ("0", "1", "25", ".", "-", "+", "e", "E", "e3", "E-2", " ", "  ", "\n", "x", "^", "/")
NUMBERS = st.floats(-1e9, 1e9) | st.integers(-99, 99) | st.sampled_from(["0", "-0.0", "+0.50", ".5", "5.", "0e5", "-1"])
TEXTS = st.lists(st.sampled_from([*SYMBOLS, *PIECES]), max_size=7).map("".join) | st.builds(
    "{}{}{}".format, NUMBERS, st.sampled_from(["", " ", "\n"]), st.sampled_from(SYMBOLS)
)


@given(TEXTS, st.sampled_from(DIMENSIONS))
def test_the_pattern_of_a_quantity_takes_what_is_read(text: str, dimension: units.Dimension) -> None:
    pattern = text_schema(Annotated[float, Quantity((dimension,))])["pattern"]
    # Spaces other than " " are read, too.
    if "\n" not in text.strip() and not text.startswith("\n"):
        assert bool(re.search(pattern, text)) is is_read(text, (dimension,))


@given(NUMBERS, st.sampled_from(["", "m", " cm", " kg"]))
def test_a_lower_bound_takes_signs_and_zero_from_the_pattern(number: float | str, unit: str) -> None:
    plain = text_schema(Metres)["pattern"]
    assert pattern_at_least(plain, -1, exclusive=True) == plain
    text, fits = f"{number}{unit}", unit != " kg"
    assert bool(re.search(plain, text)) is fits
    for pattern, is_positive in (
        (pattern_at_least(plain, 0, exclusive=False), not text.startswith("-")),
        (pattern_at_least(plain, 0, exclusive=True), float(number) > 0),
        (pattern_at_least(plain, 0.1, exclusive=False), float(number) > 0),
    ):
        assert bool(re.search(pattern, text)) is (fits and is_positive)


def test_the_schema_says_how_a_quantity_is_written() -> None:
    for kind, text in ((Metres, "20 m"), (PositiveSeconds, "20 s"), (PositiveRadians, "90 deg")):
        schema = text_schema(kind)
        assert schema["description"].startswith(f"number, or text such as {text}; units: ")
        # Validators show the pattern.
        assert schema["pattern"].startswith(f"(?!)number, or text such as {text}|")
        assert not re.search(schema["pattern"], f"number, or text such as {text}")
        assert re.search(schema["pattern"], schema["examples"][0])
    assert TypeAdapter(field_types.NonNegativeRatio).json_schema() == {"minimum": 0, "type": "number"}
    # A quantity of several dimensions says all of them.
    adapter = TypeAdapter[float](Annotated[float, Quantity((units.ANGLE, units.LENGTH))])
    assert adapter.validate_python("180 deg") == pytest.approx(math.pi)
    with pytest.raises(ValidationError, match="not a unit of angle or length"):
        adapter.validate_python("1 kg")


class BoundedSpec(FrozenModel):
    plain: float
    positive: PositiveMetres
    pixels: Annotated[int, Field(ge=1, le=1920)]
    angle: Annotated[PositiveRadians, Field(le=math.radians(170))]
    optional: Annotated[PositiveRadians | None, Field(lt=math.pi / 2)] = None
    nested: Annotated[PositiveSeconds, Field(le=86_400)] | None = None
    rate: Annotated[PositiveHertz, Field(ge=1, le=100_000)]
    far: Annotated[Metres, Field(ge=-1e6, le=1e6)]
    near: Annotated[Metres, Field(ge=0.001)]
    error: Annotated[Ratio, Field(gt=-1)]
    many: tuple[PositiveMetres, ...]
    joint: JointPosition
    shares: Annotated[tuple[Ratio, ...], Field(min_length=2)]


@pytest.mark.parametrize(
    ("name", "bounds", "unit"),
    [
        ("plain", "", ""),
        ("positive", "", "m"),
        ("pixels", "1 to 1920", ""),
        ("angle", "at most 170 deg", "rad"),
        ("optional", "less than 90 deg", "rad"),
        ("nested", "at most 86,400 s", "s"),
        ("rate", "1 to 100,000 Hz", "Hz"),
        ("far", "-1,000,000 to 1,000,000 m", "m"),
        ("near", "at least 0.001 m", "m"),
        ("error", "more than -1", ""),
        ("many", "", "m"),
        ("joint", "", ""),
        ("shares", "", ""),
    ],
)
def test_bounds_of_a_key(name: str, bounds: str, unit: str) -> None:
    field = BoundedSpec.model_fields[name]
    assert bounds_text(field.annotation, field.metadata) == bounds
    assert unit_of(field.annotation, field.metadata) == unit


def test_a_bound_has_all_its_digits() -> None:
    assert bound_text(1_000_000_000, "") == "1,000,000,000"
    assert bound_text(2**63 - 1, "") == "9,223,372,036,854,775,807"
    assert bound_text(0.0, "m") == "0"
    assert [bound_text(size, "B") for size in (512 * 2**20, 2**40, 1000)] == ["512 MiB", "1024 GiB", "1000 B"]
    assert bound_text(math.pi, "rad/s") == "180 deg/s"
