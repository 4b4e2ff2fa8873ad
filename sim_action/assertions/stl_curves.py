"""What a formula looks at over time: the two sides of its comparisons, and its robustness."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

import numpy as np

from sim_action.assertions.stl_parts import Part
from sim_action.assertions.temporal_logic.formula import Comparison, Formula, Implies, Not, Sum, parts, signals
from sim_action.assertions.temporal_logic.robustness import values
from sim_action.assertions.temporal_logic.samples import Samples
from sim_action.state.verdict import Signal

# To fold a formula that is judged at the end takes as long at each moment as all that came before.
_MOST_MOMENTS: Final = 60


class Asked(NamedTuple):
    """A comparison, and whether it is its contrary that makes the formula true."""

    comparison: Comparison
    contrary: bool


def asked(formula: Formula, *, contrary: bool = False) -> Iterator[Asked]:
    """All comparisons of a formula, from the left."""
    match formula:
        case Comparison():
            yield Asked(formula, contrary)
        case Not():
            yield from asked(formula.formula, contrary=not contrary)
        case Implies():
            yield from asked(formula.premise, contrary=not contrary)
            yield from asked(formula.conclusion, contrary=contrary)
        case _:
            for part in parts(formula):
                yield from asked(part, contrary=contrary)


def compared(formula: Formula, samples: Samples, units: Mapping[Comparison, str]) -> Iterator[Signal]:
    """A curve for each comparison, each once: what a verdict measures, against its limit."""
    for comparison, contrary in dict.fromkeys(asked(formula)):
        left, right = (values(term, samples) for term in (comparison.left, comparison.right))
        name, limit = str(comparison.left), float(right[0])
        if any(signals(comparison.right)):
            name, left, limit = f"{comparison.left} - {_inside(comparison)}", left - right, 0.0
        is_upper = comparison.relation in ("<", "<=")
        lower, upper = (None, limit) if is_upper != contrary else (limit, None)
        yield Signal(name, units[comparison], samples.time, left, lower, upper)


def _inside(comparison: Comparison) -> str:
    return f"({comparison.right})" if isinstance(comparison.right, Sum) else str(comparison.right)


def robustness_so_far(part: Part, samples: Samples, unit: str) -> Signal:
    """What the margin of a whole formula would be, were the run over at each moment; nothing where none counts yet."""
    count = min(len(samples), _MOST_MOMENTS)
    ends = np.unique(np.linspace(1, len(samples), count).round().astype(np.intp))
    margins, begin = [], 0
    for end in ends.tolist():
        part = part.observe(samples.between(begin, end))
        margins.append(part.outcome()[0])
        begin = end
    margin = np.array(margins)
    finite = np.where(np.isfinite(margin), margin, np.nan)
    return Signal("robustness", unit, samples.time[ends - 1], finite, lower=0.0).at_end()
