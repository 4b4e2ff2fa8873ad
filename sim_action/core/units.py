"""Conversion of quantities with units ("30 s", "90 deg", "1.5 m") to and from SI floats.

A bare number is SI already. Prefixes and symbols are from the SI brochure (BIPM, 9th edition). At the end: the
rounding of sim times to physics steps.
"""

from __future__ import annotations

import math
import re
from types import MappingProxyType
from typing import Final

from sim_action.core.records import dataclass
from sim_action.core.wording import shown

_DEGREE: Final = math.pi / 180
MAX_BARE_RAD: Final = 6.29
"""The greatest angle, and angular speed, without a unit: one turn, rounded up, because 2 pi may be rounded."""

_BYTES: Final = ((1e9, "GB"), (1e6, "MB"), (1e3, "kB"))
ALL_DIGITS: Final = 18
"""All floats differ with 17 digits; one more, because `display` shows one digit less with an exponent."""


@dataclass(frozen=True, slots=True, eq=False)
class Dimension:
    """A kind of quantity: its name, its SI unit, and the factor from each accepted unit to SI."""

    name: str
    si: str
    factors: MappingProxyType[str, float]
    example: str  # a usual value in text, for descriptions


_DIMENSIONS: Final[list[Dimension]] = []  # all with units, in the order of messages


def _dimension(name: str, si: str, others: dict[str, float] | None = None, example: str = "") -> Dimension:
    dimension = Dimension(name, si, MappingProxyType({si: 1.0, **(others or {})}), example or f"20 {si}")
    if any(dimension.factors):
        _DIMENSIONS.append(dimension)
    return dimension


TIME: Final = _dimension("time", "s", {"ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0})
LENGTH: Final = _dimension("length", "m", {"mm": 1e-3, "cm": 1e-2, "km": 1e3})
ANGLE: Final = _dimension("angle", "rad", {"deg": _DEGREE}, "90 deg")
FREQUENCY: Final = _dimension("frequency", "Hz", {"kHz": 1e3})
MASS: Final = _dimension("mass", "kg", {"g": 1e-3, "t": 1e3})
SPEED: Final = _dimension("speed", "m/s", {"mm/s": 1e-3, "cm/s": 1e-2, "km/h": 1 / 3.6})
ANGULAR_SPEED: Final = _dimension("angular speed", "rad/s", {"deg/s": _DEGREE, "rpm": 2 * math.pi / 60}, "90 deg/s")
ACCELERATION: Final = _dimension("acceleration", "m/s^2", {"cm/s^2": 1e-2})
FORCE: Final = _dimension("force", "N", {"mN": 1e-3, "kN": 1e3})
IMPULSE: Final = _dimension("impulse", "N s", {"Ns": 1.0, "mN s": 1e-3, "kN s": 1e3})
TORQUE: Final = _dimension("torque", "N m", {"Nm": 1.0})
ENERGY: Final = _dimension("energy", "J", {"mJ": 1e-3, "kJ": 1e3, "Wh": 3600.0, "kWh": 3.6e6})
INERTIA: Final = _dimension("moment of inertia", "kg m^2", {"g m^2": 1e-3})
RATIO: Final = _dimension("ratio", "")
SHARE: Final = _dimension("share", "", {"%": 1e-2}, "20 %")
DATA: Final = _dimension(
    "amount of data", "B", {"kB": 1e3, "MB": 1e6, "GB": 1e9, "KiB": 2.0**10, "MiB": 2.0**20, "GiB": 2.0**30}, "2 GB"
)

_QUANTITY: Final = re.compile(r"([-+]?(?:[0-9]++\.?[0-9]*+|\.[0-9]++)(?:[eE][-+]?[0-9]++)?)\s*+(\S.*)?")


class UnitError(ValueError):
    """A text that is not a quantity of the expected dimension; the message states the expected one."""


def parse(value: object, *dimensions: Dimension) -> float:
    """Return the SI value of a number, or of a text with a unit of `dimensions`. Raise UnitError."""
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise UnitError(f"{_expected(dimensions)}, found {shown(value)}")
    try:
        number = _parse_text(value, dimensions) if isinstance(value, str) else float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise UnitError(f"{_expected(dimensions, 'a finite ')}, found {shown(value)}")
    return number


def is_bare(value: object) -> bool:
    """Return True for a number, or the text of one, without a unit."""
    if isinstance(value, str):
        match = _QUANTITY.fullmatch(value.strip())
        return match is not None and match[2] is None
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def beyond_a_turn(value: object, unit: str = "rad", most: float = MAX_BARE_RAD) -> str | None:
    """Return the problem of an angle or angular speed without a unit that is more than `most`, else None."""
    if not is_bare(value) or abs(number := float(str(value))) <= most:
        return None
    degrees = unit.replace("rad", "deg")
    turn = "more than one turn" if unit == "rad" else f"{display(number, unit)}"
    meant = f"write '{number:g} {degrees}' if degrees are meant, else '{number:g} {unit}'"
    return f"{number:g} without a unit is in {unit}, {'and ' if unit == 'rad' else 'which is '}{turn}; {meant}"


def with_si_unit(value: object) -> tuple[float, str]:
    """Return the SI value of a number or text, and the SI unit, "" without one. Raise UnitError."""
    number = parse(value, *_DIMENSIONS)
    match = _QUANTITY.fullmatch(value.strip()) if isinstance(value, str) else None
    unit = match[2] if match is not None else None
    return number, next((dimension.si for dimension in _DIMENSIONS if unit in dimension.factors), "") if unit else ""


def conversion(unit: str, other: str) -> float | None:
    """Return how many `other` one `unit` is; None if they do not share a dimension."""
    shared = (dimension.factors for dimension in _DIMENSIONS if {unit, other} <= dimension.factors.keys())
    return next((factors[unit] / factors[other] for factors in shared), None)


def _parse_text(text: str, dimensions: tuple[Dimension, ...]) -> float:
    match = _QUANTITY.fullmatch(text.strip())
    if match is None:
        raise UnitError(f"{_expected(dimensions)}, found {shown(text)}")
    number, unit = match.groups()
    if unit is None:
        return float(number)
    factors = {symbol: factor for dimension in dimensions for symbol, factor in dimension.factors.items() if symbol}
    if unit not in factors:
        units = f"use one of: {', '.join(factors)}" if factors else "it takes no unit"
        names = " or ".join(dimension.name for dimension in dimensions)
        raise UnitError(f"{shown(unit)} is not a unit of {names}; {units}")
    return float(number) * factors[unit]


def _expected(dimensions: tuple[Dimension, ...], which: str = "") -> str:
    if dimensions == (SHARE,):
        return f"expected {which or 'a '}share such as 90 %"
    names = " or ".join(dimension.name for dimension in dimensions)
    example = next((f" such as '1 {dimension.si}'" for dimension in dimensions if dimension.si), " such as 0.5")
    return f"expected {which}{names}{example}"


def display(value: float, unit: str, digits: int = 4) -> str:
    """Return a value for people: four significant digits, angles in degrees, no trailing zeros."""
    value += 0.0  # not "-0 m"
    if unit in ("rad", "rad/s"):
        value, unit = value / _DEGREE, unit.replace("rad", "deg")
    if unit == "B":
        factor, unit = next(((factor, name) for factor, name in _BYTES if abs(value) >= factor), (1.0, unit))
        value /= factor
    if unit == "contacts" and abs(value) == 1:
        unit = "contact"
    digits -= not 1e-3 <= abs(value) < 1e6  # the exponent takes room
    return f"{value:.{digits}g} {unit}".rstrip()


def display_apart(value: float, limit: float, unit: str) -> tuple[str, str]:
    """Return a value and its limit with enough digits to show their difference."""
    texts = display(value, unit), display(limit, unit)
    for digits in range(5, ALL_DIGITS + 1):
        if texts[0] != texts[1] or value == limit:
            break
        texts = display(value, unit, digits), display(limit, unit, digits)
    return texts


TIME_EPSILON_S: Final = 1e-9
"""In s: sim time is step / rate, and two computations of the same moment differ by rounding only."""

STEP_EPSILON: Final = 1e-6  # a share of a step: a time that is later than a step by at most this belongs to the step


_MAX_STEP: Final = 2.0**53  # beyond, floats cannot distinguish steps


_MAX_STEPS_BETWEEN_TICKS: Final = 1e15


def rate_divides(physics_rate: float, rate: float) -> bool:
    """Return True if ticks at `rate` fall on physics steps, whose number fits into the integers of arrays."""
    steps = physics_rate / rate
    return steps <= _MAX_STEPS_BETWEEN_TICKS and round(steps) >= 1 and abs(steps - round(steps)) < STEP_EPSILON


def first_step(time: float, rate: float) -> int:
    """Return the first physics step at or after a sim time in s, at `rate` Hz; it fits into 64 bits."""
    return math.ceil(min(time * rate - STEP_EPSILON, _MAX_STEP))
