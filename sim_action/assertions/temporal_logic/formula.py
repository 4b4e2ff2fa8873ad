"""Formulas and the terms that they compare; `str` gives the text that is parsed to the same formula.

`at` is where in the text a part begins, counted from 0; it does not count when two are compared.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final, Literal, TypeAlias


@dataclass(frozen=True, slots=True)
class Number:
    """A constant: its SI value, and the SI symbol of the unit that it was written with; empty without one."""

    value: float
    unit: str = ""
    at: int = field(default=0, compare=False)

    def __str__(self) -> str:
        return f"{_exact(self.value)} {self.unit}".rstrip()


@dataclass(frozen=True, slots=True)
class Signal:
    """What is sampled at every moment; `joint` is empty for signals of the base."""

    name: str
    joint: str = ""
    at: int = field(default=0, compare=False)

    def __str__(self) -> str:
        return f"{self.name}({self.joint})" if self.joint else self.name


@dataclass(frozen=True, slots=True)
class Negative:
    """A term with the other sign."""

    term: Term
    at: int = field(default=0, compare=False)

    def __str__(self) -> str:
        return f"-{_inside(self.term, Sum, Product)}"


@dataclass(frozen=True, slots=True)
class Absolute:
    """A term without its sign."""

    term: Term
    at: int = field(default=0, compare=False)

    def __str__(self) -> str:
        return f"abs({self.term})"


@dataclass(frozen=True, slots=True)
class Sum:
    """Two terms or more; what is subtracted is Negative."""

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
    """Two factors or more."""

    factors: tuple[Term, ...]
    at: int = field(default=0, compare=False)

    def __str__(self) -> str:
        return " * ".join(_inside(factor, Sum, Product) for factor in self.factors)


Term: TypeAlias = Number | Signal | Negative | Absolute | Sum | Product

Relation = Literal["<", "<=", ">", ">="]


@dataclass(frozen=True, slots=True)
class Interval:
    """From when to when, in s after the moment that an operator is judged at; both ends belong to it."""

    start: float = 0.0
    end: float = math.inf
    at: int = field(default=0, compare=False)

    def __str__(self) -> str:
        if self == ALL_TIME:
            return ""
        return f"[{_exact(self.start)} s, {'end' if math.isinf(self.end) else f'{_exact(self.end)} s'}]"


ALL_TIME: Final = Interval()
"""From a moment to the end of the run."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """Two terms of one dimension; its robustness is their difference, so `<` and `<=` are the same."""

    left: Term
    relation: Relation
    right: Term
    at: int = field(default=0, compare=False)

    def __str__(self) -> str:
        return f"{self.left} {self.relation} {self.right}"


@dataclass(frozen=True, slots=True)
class Not:
    """The contrary."""

    formula: Formula

    def __str__(self) -> str:
        return f"not ({self.formula})"


@dataclass(frozen=True, slots=True)
class And:
    """All of two or more."""

    formulas: tuple[Formula, ...]

    def __str__(self) -> str:
        return " and ".join(f"({formula})" for formula in self.formulas)


@dataclass(frozen=True, slots=True)
class Or:
    """Any of two or more."""

    formulas: tuple[Formula, ...]

    def __str__(self) -> str:
        return " or ".join(f"({formula})" for formula in self.formulas)


@dataclass(frozen=True, slots=True)
class Implies:
    """Where the first holds, the second does."""

    premise: Formula
    conclusion: Formula

    def __str__(self) -> str:
        return f"({self.premise}) implies ({self.conclusion})"


@dataclass(frozen=True, slots=True)
class Always:
    """At every moment of an interval."""

    formula: Formula
    interval: Interval = ALL_TIME

    def __str__(self) -> str:
        return f"always{self.interval} ({self.formula})"


@dataclass(frozen=True, slots=True)
class Eventually:
    """At some moment of an interval."""

    formula: Formula
    interval: Interval = ALL_TIME

    def __str__(self) -> str:
        return f"eventually{self.interval} ({self.formula})"


@dataclass(frozen=True, slots=True)
class Until:
    """The second holds at some moment of an interval, and the first at every moment before that one."""

    before: Formula
    then: Formula
    interval: Interval = ALL_TIME

    def __str__(self) -> str:
        return f"({self.before}) until{self.interval} ({self.then})"


Formula: TypeAlias = Comparison | Not | And | Or | Implies | Always | Eventually | Until


def parts(formula: Formula) -> tuple[Formula, ...]:
    """What a formula says something of."""
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


def everything(formula: Formula) -> Iterator[Formula]:
    """A formula and all that is inside it."""
    yield formula
    for part in parts(formula):
        yield from everything(part)


def comparisons(formula: Formula) -> Iterator[Comparison]:
    """All comparisons of a formula, from the left."""
    return (part for part in everything(formula) if isinstance(part, Comparison))


def signals(term: Term) -> Iterator[Signal]:
    """All signals of a term, from the left."""
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
    """The signals of a formula, each once."""
    return tuple(
        dict.fromkeys(
            signal
            for comparison in comparisons(formula)
            for term in (comparison.left, comparison.right)
            for signal in signals(term)
        )
    )


def horizon(formula: Formula) -> float:
    """How long after a moment, in s, it is known whether a formula holds there; infinite without bounds."""
    inner = max(map(horizon, parts(formula)), default=0.0)
    return inner + formula.interval.end if isinstance(formula, Always | Eventually | Until) else inner


def _exact(value: float) -> str:
    """All its digits."""
    return repr(value).removesuffix(".0")


def _inside(term: Term, *weaker: type) -> str:
    """In parentheses, if it binds no stronger than what it stands in."""
    return f"({term})" if isinstance(term, weaker) else str(term)
