"""Formulas and terms as frozen types. `str` returns text that parses to the same formula.

`at` is the index in the text at which a part begins. It is ignored in comparisons.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Final, Literal, TypeAlias

from sim_action.assertions.temporal_logic import quoted
from sim_action.core.records import dataclass, field


@dataclass(frozen=True, slots=True)
class Number:
    """A constant."""

    value: float  # the SI value
    unit: str = ""  # the SI symbol of the unit that it was written with; empty without one
    at: int = field(default=0, compare=False)
    # the number as it was written, with its unit; empty if it was not read from a text
    text: str = field(default="", compare=False)

    def __str__(self) -> str:
        return self.text or f"{_exact(self.value)} {self.unit}".rstrip()


Source = Literal["robot", "frame", "sensor", "pair"]
"""The kind of a signal: of the base or a joint, of a link or an object, of a sensor, or between links and objects."""

_RAW_JOINT: Final = re.compile(r"[^()<>'\"\s]([^()<>'\"]*[^()<>'\"\s])?")


@dataclass(frozen=True, slots=True)
class Signal:
    """A signal with a value at every step."""

    name: str
    joint: str = ""  # the joint of a signal of a joint; else empty
    at: int = field(default=0, compare=False)
    source: Source = "robot"  # the kind of the signal
    # the link or object of a "frame"; the sensor and its axis or statistic, if any, of a "sensor"; the links and
    # objects of a "pair"
    names: tuple[str, ...] = ()

    def __str__(self) -> str:
        if self.joint:
            joint = self.joint if _RAW_JOINT.fullmatch(self.joint) else quoted(self.joint)
            return f"{self.name}({joint})"
        if self.source in ("frame", "sensor"):
            owner, *part = self.names
            return ".".join((quoted(owner), self.name, *part))
        return f"{self.name}({', '.join(map(quoted, self.names))})" if self.names else self.name


@dataclass(frozen=True, slots=True)
class Negative:
    """A term with the opposite sign."""

    term: Term
    at: int = field(default=0, compare=False)

    def __str__(self) -> str:
        return f"-{_inside(self.term, Sum, Product)}"


@dataclass(frozen=True, slots=True)
class Absolute:
    """The absolute value of a term."""

    term: Term
    at: int = field(default=0, compare=False)

    def __str__(self) -> str:
        return f"abs({self.term})"


@dataclass(frozen=True, slots=True)
class Sum:
    """A sum of two terms or more; subtracted terms are Negative."""

    terms: tuple[Term, ...]
    at: int = field(default=0, compare=False)

    def __str__(self) -> str:
        first, *others = self.terms
        return _inside(first, Sum) + "".join(
            f" - {_inside(term.term, Sum, Product)}" if isinstance(term, Negative) else f" + {_inside(term, Sum)}"
            for term in others
        )


@dataclass(frozen=True, slots=True)
class Product:
    """A product of two factors or more."""

    factors: tuple[Term, ...]
    at: int = field(default=0, compare=False)

    def __str__(self) -> str:
        return " * ".join(_inside(factor, Sum, Product) for factor in self.factors)


Term: TypeAlias = Number | Signal | Negative | Absolute | Sum | Product
Relation = Literal["<", "<=", ">", ">="]


@dataclass(frozen=True, slots=True)
class Interval:
    """A closed interval in s, relative to the time at which its operator is judged."""

    start: float = 0.0
    end: float = math.inf
    at: int = field(default=0, compare=False)

    @property
    def is_finite(self) -> bool:
        """True if the interval ends before the end of the run."""
        return math.isfinite(self.end)

    @property
    def bound(self) -> float:
        """The greatest finite bound: the end, or the start of an interval without an end."""
        return self.end if self.is_finite else self.start

    def __str__(self) -> str:
        if self == ALL_TIME:
            return ""
        return f"[{_exact(self.start)} s, {'end' if math.isinf(self.end) else f'{_exact(self.end)} s'}]"


ALL_TIME: Final = Interval()  # the interval from a step to the end of the run


@dataclass(frozen=True, slots=True)
class Comparison:
    """A comparison of two terms of one dimension. Its robustness is the difference, so `<` and `<=` are equal."""

    left: Term
    relation: Relation
    right: Term
    at: int = field(default=0, compare=False)

    def __str__(self) -> str:
        return f"{self.left} {self.relation} {self.right}"


@dataclass(frozen=True, slots=True)
class Not:
    """The negation of a formula."""

    formula: Formula

    def __str__(self) -> str:
        return f"not ({self.formula})"


@dataclass(frozen=True, slots=True)
class And:
    """The conjunction of two formulas or more."""

    formulas: tuple[Formula, ...]

    def __str__(self) -> str:
        return " and ".join(f"({formula})" for formula in self.formulas)


@dataclass(frozen=True, slots=True)
class Or:
    """The disjunction of two formulas or more."""

    formulas: tuple[Formula, ...]

    def __str__(self) -> str:
        return " or ".join(f"({formula})" for formula in self.formulas)


@dataclass(frozen=True, slots=True)
class Implies:
    """If `premise` holds, `conclusion` holds."""

    premise: Formula
    conclusion: Formula

    def __str__(self) -> str:
        return f"({self.premise}) implies ({self.conclusion})"


@dataclass(frozen=True, slots=True)
class Always:
    """The formula holds at every step of the interval."""

    formula: Formula
    interval: Interval = ALL_TIME

    def __str__(self) -> str:
        return f"always{self.interval} ({self.formula})"


@dataclass(frozen=True, slots=True)
class Eventually:
    """The formula holds at some step of the interval."""

    formula: Formula
    interval: Interval = ALL_TIME

    def __str__(self) -> str:
        return f"eventually{self.interval} ({self.formula})"


@dataclass(frozen=True, slots=True)
class Until:
    """`then` holds at some step of the interval, and `before` at every step before that one."""

    before: Formula
    then: Formula
    interval: Interval = ALL_TIME

    def __str__(self) -> str:
        return f"({self.before}) until{self.interval} ({self.then})"


Formula: TypeAlias = Comparison | Not | And | Or | Implies | Always | Eventually | Until


def parts(formula: Formula) -> tuple[Formula, ...]:
    """Return the direct subformulas of a formula."""
    match formula:
        case Comparison():
            return ()
        case And() | Or():
            return formula.formulas
        case Implies():
            return formula.premise, formula.conclusion
        case Until():
            return formula.before, formula.then
        case _:
            return (formula.formula,)


def signed_parts(formula: Formula, contrary: bool) -> tuple[tuple[Formula, bool], ...]:
    """Return the direct subformulas of a formula, or of its negation (`contrary`).

    Each comes with True if its own negation makes the whole true.
    """
    if isinstance(formula, Not):
        return ((formula.formula, not contrary),)
    if isinstance(formula, Implies):
        return (formula.premise, not contrary), (formula.conclusion, contrary)
    return tuple((part, contrary) for part in parts(formula))


def everything(formula: Formula) -> Iterator[Formula]:
    """Yield a formula and all its subformulas."""
    yield formula
    for part in parts(formula):
        yield from everything(part)


def comparisons(formula: Formula) -> Iterator[Comparison]:
    """Yield all comparisons of a formula, from the left."""
    return (part for part in everything(formula) if isinstance(part, Comparison))


def signals(term: Term) -> Iterator[Signal]:
    """Yield all signals of a term, from the left."""
    match term:
        case Signal():
            yield term
        case Negative() | Absolute():
            yield from signals(term.term)
        case Sum():
            for part in term.terms:
                yield from signals(part)
        case Product():
            for factor in term.factors:
                yield from signals(factor)


def signals_of(formula: Formula) -> tuple[Signal, ...]:
    """Return the signals of a formula, each once."""
    return tuple(
        dict.fromkeys(
            signal
            for comparison in comparisons(formula)
            for term in (comparison.left, comparison.right)
            for signal in signals(term)
        )
    )


def horizon(formula: Formula) -> float:
    """Return the time in s after which the truth of a formula at a step is known; infinite if unbounded."""
    inner = max(map(horizon, parts(formula)), default=0.0)
    return inner + formula.interval.end if isinstance(formula, Always | Eventually | Until) else inner


def finite_horizon(formula: Formula) -> float:
    """Return the time in s that a formula looks ahead at least. An interval without an end counts up to its start."""
    inner = max(map(finite_horizon, parts(formula)), default=0.0)
    return inner + formula.interval.bound if isinstance(formula, Always | Eventually | Until) else inner


def _exact(value: float) -> str:
    return repr(value).removesuffix(".0")


def _inside(term: Term, *weaker: type) -> str:
    return f"({term})" if isinstance(term, weaker) else str(term)
