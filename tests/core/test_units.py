from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core import units
from sim_action.core.units import Dimension, UnitError, display, display_apart, parse

DIMENSIONS = [value for value in vars(units).values() if isinstance(value, Dimension)]


@pytest.mark.parametrize(
    ("text", "dimension", "si"),
    [
        (30, units.TIME, 30.0),
        (1.5, units.LENGTH, 1.5),
        ("30", units.TIME, 30.0),
        ("30 s", units.TIME, 30.0),
        ("30s", units.TIME, 30.0),
        ("  2 min ", units.TIME, 120.0),
        ("1 h", units.TIME, 3600.0),
        ("250 ms", units.TIME, 0.25),
        ("7 us", units.TIME, 7e-6),
        ("1.5 m", units.LENGTH, 1.5),
        ("3 cm", units.LENGTH, 0.03),
        ("1.5e2 mm", units.LENGTH, 0.15),
        (".5 km", units.LENGTH, 500.0),
        ("-1. m", units.LENGTH, -1.0),
        ("+2 m", units.LENGTH, 2.0),
        ("90 deg", units.ANGLE, math.pi / 2),
        ("10 Hz", units.FREQUENCY, 10.0),
        ("1 kHz", units.FREQUENCY, 1000.0),
        ("500 g", units.MASS, 0.5),
        ("2 t", units.MASS, 2000.0),
        ("36 km/h", units.SPEED, 10.0),
        ("60 rpm", units.ANGULAR_SPEED, 2 * math.pi),
        ("180 deg/s", units.ANGULAR_SPEED, math.pi),
        ("100 cm/s^2", units.ACCELERATION, 1.0),
        ("1 kN", units.FORCE, 1000.0),
        ("3 N m", units.TORQUE, 3.0),
        ("3 Nm", units.TORQUE, 3.0),
        (0.8, units.RATIO, 0.8),
    ],
)
def test_a_quantity_is_read_as_si(text: object, dimension: Dimension, si: float) -> None:
    assert parse(text, dimension) == pytest.approx(si, rel=1e-15)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (None, "expected time such as '1 s', found nothing"),
        (True, "expected time such as '1 s', found true"),
        ("", "expected time such as '1 s', found ''"),
        ("soon", "expected time such as '1 s', found 'soon'"),
        ("nan s", "expected time such as '1 s', found 'nan s'"),
        ("1:30", "':30' is not a unit of time; use one of: s, ms, us, min, h"),
        ("3 kg", "'kg' is not a unit of time; use one of: s, ms, us, min, h"),
        ("3 S", "'S' is not a unit of time; use one of: s, ms, us, min, h"),
        ("1,5 s", "',5 s' is not a unit of time; use one of: s, ms, us, min, h"),
        ("1_0", "'_0' is not a unit of time; use one of: s, ms, us, min, h"),
        ("1 a\x07::error::", "'a\\x07::error::' is not a unit of time; use one of: s, ms, us, min, h"),
        ("1 s\n::error::", "expected time such as '1 s', found '1 s\\n::error::'"),
        (math.nan, "expected a finite time such as '1 s', found nan"),
        (-math.inf, "expected a finite time such as '1 s', found -inf"),
        ("1e999 s", "expected a finite time such as '1 s', found '1e999 s'"),
        ("1e308 h", "expected a finite time such as '1 s', found '1e308 h'"),
        ({"s": 1}, "expected time such as '1 s', found a map of keys"),
    ],
)
def test_what_is_no_time_is_refused_with_what_would_be(value: object, message: str) -> None:
    with pytest.raises(UnitError) as raised:
        parse(value, units.TIME)
    assert str(raised.value) == message


def test_ratios_joints_and_numbers_of_any_size() -> None:
    with pytest.raises(UnitError, match="'%' is not a unit of ratio; it takes no unit"):
        parse("50 %", units.RATIO)
    with pytest.raises(UnitError, match=r"expected ratio such as 0\.5, found 'half'"):
        parse("half", units.RATIO)
    assert parse("90 deg", units.ANGLE, units.LENGTH) == pytest.approx(math.pi / 2)
    assert parse("5 cm", units.ANGLE, units.LENGTH) == pytest.approx(0.05)
    with pytest.raises(UnitError, match="'s' is not a unit of angle or length; use one of: rad, deg, m, mm, cm, km"):
        parse("5 s", units.ANGLE, units.LENGTH)
    with pytest.raises(UnitError, match="expected a finite time"):
        parse(10**400, units.TIME)
    with pytest.raises(UnitError) as raised:
        parse("1" * 1_000_000 + " a\nb", units.TIME)
    assert len(str(raised.value)) < 200


@given(st.floats(allow_nan=False, allow_infinity=False), st.sampled_from(DIMENSIONS))
def test_a_number_in_its_si_unit_is_that_number(number: float, dimension: Dimension) -> None:
    assert parse(f"{number!r} {dimension.si}", dimension) == number == parse(number, dimension)


@given(st.text() | st.floats() | st.integers() | st.none() | st.binary())
def test_anything_is_a_finite_float_or_a_unit_error(value: object) -> None:
    try:
        assert math.isfinite(parse(value, units.LENGTH))
    except UnitError as error:
        assert "length" in str(error)  # noqa: PT017 - either is right


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (1.5, "m", "1.5 m"),
        (1.23456, "m", "1.235 m"),
        (2.0, "s", "2 s"),
        (0.0, "m", "0 m"),
        (-0.0, "m", "0 m"),
        (1e-9, "m", "1e-09 m"),
        (math.pi / 2, "rad", "90 deg"),
        (math.pi, "rad/s", "180 deg/s"),
        (3.0, "", "3"),
        (1234567.0, "N", "1.23e+06 N"),
        (math.inf, "m", "inf m"),
        (10e3, "B", "10 kB"),
        (1.5e6, "B", "1.5 MB"),
        (4e9, "B", "4 GB"),
        (12, "B", "12 B"),
    ],
)
def test_values_are_displayed_as_people_read_them(value: float, unit: str, text: str) -> None:
    assert display(value, unit) == text


@pytest.mark.parametrize(
    ("value", "limit", "texts"),
    [
        (1.0, 1.5, ("1 m", "1.5 m")),
        (1.5, 1.5, ("1.5 m", "1.5 m")),
        (1.49999, 1.5, ("1.49999 m", "1.5 m")),
        (1.23456, 1.23457, ("1.23456 m", "1.23457 m")),
        (0.000123, 0.0001231, ("0.000123 m", "0.0001231 m")),
    ],
)
def test_a_value_that_is_not_its_limit_looks_different(value: float, limit: float, texts: tuple[str, str]) -> None:
    assert display_apart(value, limit, "m") == texts


@given(st.floats(), st.floats() | st.none())
def test_all_floats_that_differ_look_different(value: float, other: float | None) -> None:
    limit = math.nextafter(value, math.inf) if other is None else other
    texts = display_apart(value, limit, "m")
    assert (texts[0] == texts[1]) == (value == limit or (math.isnan(value) and math.isnan(limit)))


def test_units_are_converted_within_their_dimension() -> None:
    assert units.conversion("m", "cm") == 100.0
    assert units.conversion("deg", "rad") == pytest.approx(math.pi / 180)
    assert units.conversion("m", "s") is None
    assert units.conversion("furlong", "m") is None
    symbols = [symbol for dimension in DIMENSIONS for symbol in dimension.factors if symbol]
    assert len(symbols) == len(set(symbols))
    assert all(units.conversion(symbol, symbol) == 1 for symbol in symbols)


@given(st.floats(0.001, 6.28))
def test_an_angle_needs_a_unit_beyond_a_turn_only(number: float) -> None:
    assert units.beyond_a_turn(number) is None
    assert units.beyond_a_turn(f"{number}") is None
    beyond = -(number + 6.29)
    problem = units.beyond_a_turn(beyond)
    assert problem is not None
    assert problem == units.beyond_a_turn(f" {beyond} ")
    assert f"'{beyond:g} deg'" in problem
    assert units.beyond_a_turn(f"{beyond} rad") is None
    assert units.beyond_a_turn(f"{beyond}deg") is None


@pytest.mark.parametrize("value", [True, None, "far", "90 deg", "", [90]])
def test_only_a_number_is_bare(value: object) -> None:
    assert not units.is_bare(value)
    assert units.beyond_a_turn(value) is None
