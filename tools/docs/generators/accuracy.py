"""The table of accuracy: the largest error of each engine over groups of cases of the zoo (tests/physics)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Final

from tests.physics.case import BETWEEN, Case
from tests.physics.record import RECORDED
from tests.physics.zoo import ZOO
from tools.docs.generators.markdown import table

TOPICS: Final = (
    ("caster robots of 1 to 40 kg, caster friction 0 to 1: speed ahead", ("caster * line",)),
    ("the same: turn rate on a circle and on the spot", ("caster * circle", "caster * spin")),
    ("robot of 5.9 kg whose wheels and caster have friction 0.5: distance", ("delivery robot line",)),
    ("built-in burger: line, circle, spin", ("burger line", "burger fast line", "burger circle *", "burger spin *")),
    (
        "burger in an eight, robot that brakes: length of the path",
        ("burger drives an eight*", "caster robot stops: way"),
    ),
    (
        "built-in rover and car: distance, turn rate and radius",
        ("husky_a200 *: way", "husky_a200 *: turn rate", "f1tenth *: way", "f1tenth *: turn rate", "f1tenth *: radius"),
    ),
    ("robots that brake: tilt", ("* stops: tilt",)),
    ("skid-steered robots: turn, over start yaws of 0 to 45 deg", ("* over start yaws",)),
    ("skid-steered robots: turn, over rates of 240 to 1000 Hz", ("* over rates*",)),
    ("skid-steered rovers of five shapes: turn rate", ("rover * from * deg",)),
    ("skid-steered robots: speed in a curve", ("rover * speed", "husky * speed", "r2d2 * speed")),
    ("husky and r2d2, skid-steered: turn rate", ("husky * from * deg", "r2d2 * from * deg")),
    ("cars: turn rate and radius", ("*car at *",)),
    ("mecanum wheels: speed and turn rate", ("mecanum *",)),
    ("burger on ramps of 5 to 10 deg: speed upwards", ("burger on a ramp of *: speed",)),
    ("braked burger on these ramps: creep", ("burger on a ramp of *: creep at rest",)),
    ("robots that push a load: speed", ("* pushes *",)),
    ("box that a body on a path pushes: speed", ("box pushed by a path",)),
    ("wheels that spin on slippery ground: acceleration", ("wheels spin on ground *",)),
    ("pendulum from 5 to 150 deg: period", ("pendulum from *",)),
    ("double pendulum after 0.5 s: angle", ("double pendulum: angle",)),
    ("double pendulum in 5 s: gained energy", ("double pendulum: energy",)),
    ("arms and lifts that hold a load: effort", ("arm holds *: torque *", "lift holds *")),
    ("arms that hold a load or themselves: sag", ("*: sag",)),
    ("arm that is too weak for its load: angle after 0.2 s", ("weak motor *",)),
    ("followers of light leaders, with loads of 0.1 to 100 kg: lag", ("*: lag behind it",)),
    ("the same: effort of the leader", ("*: torque of its leader",)),
    ("arms on trajectories: lag", ("*: lag",)),
    ("built-in arm in three poses: error of the holding torques", ("ur5e_gripper *: torques",)),
    ("the same: distance of its gripper from known places", ("ur5e_gripper *: place of the gripper",)),
    ("built-in arm, step of a wrist: angle after 0.2 s", ("ur5e_gripper step: angle *",)),
    ("the same: overshoot", ("ur5e_gripper step: overshoot",)),
    ("four legs: weight on the feet", ("*: weight on its feet",)),
    ("four legs: drift", ("*: drift while it stands",)),
    ("four legs: tilt", ("*: tilt while it stands",)),
    ("four legs, dropped from 5 cm: rebound", ("*: rebound from 5 cm",)),
    ("four legs, dropped from 5 cm: speed at rest", ("*: speed after a drop",)),
    ("bodies shoved at 1 to 4 m/s, friction 0.2 to 1: distance", ("box shoved *: distance", "* shoved: distance")),
    ("the same: rise", ("box shoved *: rise", "* shoved: rise")),
    ("shoved bodies, rolling balls: gained energy", ("*: energy",)),
    ("plate on feet, shoved and turned: distance", ("plate on feet *: distance",)),
    ("the same: turn", ("plate on feet *: turn",)),
    ("pushed balls that slide, then roll: speed", ("* slides then rolls: speed",)),
    ("boxes on slopes: hold", ("box holds on *",)),
    ("boxes that slide down slopes: acceleration", ("box slides down *",)),
    ("balls that roll down a ramp: acceleration", ("* rolls down a ramp *",)),
    ("tower that stands, or tips over: tilt", ("tower on *",)),
    ("bodies dropped from 5 cm and 1 m: time", ("* dropped from *: time",)),
    ("the same: height at rest", ("* dropped from *: height at rest",)),
    ("the same: bounce", ("* dropped from *: bounce",)),
    ("stacks of 3 to 5 boxes: height", ("stack *: height",)),
    ("the same: drift", ("stack *: drift",)),
    ("impact on a wall at 240 to 960 Hz: impulse", ("*: impulse",)),
    ("braked burger that is pushed: speed at the end", ("braked burger *: speed at the end",)),
    ("the same: rise", ("braked burger *: rise",)),
    ("thrown ball: height", ("thrown ball: apex",)),
    ("thrown ball: speed", ("thrown ball: speed",)),
    ("bodies that turn freely: angular momentum", ("free body *",)),
    ("robot of 5.9 kg whose wheels and caster have friction 0.5: position after 6 s", ("delivery robot engines",)),
    ("skid-steered robots: turn", ("rover * engines", "husky * engines", "r2d2 * engines")),
    ("arms on trajectories: joints", ("* on lines: engines", "* on smooth ways: engines")),
)
"""Title of a row, and patterns of the names of its cases; a case belongs to the first row that fits."""

# Unit of cases -> factor, unit in the table.
_SHOWN: Final = {
    "m": (1000, "mm"),
    "rad": (57.29578, "deg"),
    "m/s": (1000, "mm/s"),
    "deg": (1, "deg"),
    "s": (1000, "ms"),
}
_SMALLEST: Final = 0.01
_NEAR: Final = 0.5
"""The share of the tolerance from which a row is shown."""


@dataclass(frozen=True)
class Row:
    """Cases of one kind that are shown together."""

    title: str
    cases: list[Case] = field(default_factory=list)

    @property
    def relative(self) -> bool:
        """True if errors are shares of the true value, or shares already."""
        return all(case.truth for case in self.cases) or self.cases[0].unit.startswith("of ")

    @property
    def share(self) -> float:
        """The largest error of an engine as a share of the tolerance of its case."""
        pairs = ((case, RECORDED[engine][case.name]) for case in self.cases for engine in ("pybullet", "mujoco"))
        return max(case.error(value) / case.tolerance for case, value in pairs)

    def cells(self, engines: Sequence[str]) -> Iterator[str]:
        """Yield the cells: title, tolerance, the number of cases (tuned + held out), their largest errors."""
        yield self.title
        yield self._range([self._scaled(case, case.tolerance) for case in self.cases])
        held_out = sum(case.held_out for case in self.cases)
        yield f"{len(self.cases) - held_out}+{held_out}"
        for engine in engines:
            yield self._errors(self.cases, engine)

    def _errors(self, cases: Sequence[Case], engine: str) -> str:
        errors = [(case, case.error(RECORDED[engine][case.name])) for case in cases]
        outside = sum(error > case.tolerance for case, error in errors)
        largest = self._text(max(self._scaled(case, error) for case, error in errors))
        return f"**{largest}** ({outside})" if outside else largest

    def _scaled(self, case: Case, error: float) -> float:
        if self.relative:
            return 100 * error / (abs(case.truth) or 1)
        return error * _SHOWN.get(case.unit, (1, ""))[0]

    def _text(self, number: float) -> str:
        unit = "%" if self.relative else _SHOWN.get(self.cases[0].unit, (1, self.cases[0].unit))[1]
        return f"{shown(number)} {unit}"

    def _range(self, numbers: Sequence[float]) -> str:
        low, high = self._text(min(numbers)), self._text(max(numbers))
        return low if low == high else f"{low} to {high}"


def shown(number: float) -> str:
    """Return a number with two digits, one below 1; numbers below 0.01 as a bound."""
    if number < _SMALLEST:
        return f"< {_SMALLEST}"
    return f"{number:.1g}" if number < 1 else f"{number:.2g}" if number < 100 else f"{number:.0f}"


def errors() -> str:
    """Return the table of errors against oracles, and the number of cases in rows that are far from their tolerance."""
    head = ("motion", "tolerance", "cases", "PyBullet", "MuJoCo")
    near = [row for row in _rows() if row.share >= _NEAR]
    far = sum(len(row.cases) for row in _rows() if row.share < _NEAR)
    shown = table(head, (tuple(row.cells(("pybullet", "mujoco"))) for row in near))
    return f"{shown}\nThe other {far} cases are within {100 * _NEAR:.0f} % of their tolerance.\n"


def differences() -> str:
    """Return the table of differences between the engines."""
    head = ("motion", "tolerance", "cases", "difference")
    return table(head, (tuple(row.cells((BETWEEN,))) for row in _rows(between=True)))


def _titles() -> Iterator[str]:
    """Yield the titles of TOPICS, with "the same" written out."""
    motion = ""
    for title, _ in TOPICS:
        motion = motion if title.startswith("the same") else title.rpartition(":")[0]
        yield title.replace("the same", motion)


def place(case: Case) -> int:
    """Return the index of the row of a case in TOPICS. Raises LookupError if it has none."""
    for index, (_, patterns) in enumerate(TOPICS):
        if any(fnmatchcase(case.name, pattern) for pattern in patterns):
            return index
    raise LookupError(f"no row of the table of accuracy has the case '{case.name}': add it to TOPICS")


def _rows(*, between: bool = False) -> list[Row]:
    """Return the rows with cases, in the order of TOPICS."""
    rows = [Row(title) for title in _titles()]
    for case in ZOO:
        if case.between == between:
            rows[place(case)].cases.append(case)
    return [row for row in rows if row.cases]
