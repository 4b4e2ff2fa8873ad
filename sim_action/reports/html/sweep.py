"""The varied parameters of a group of runs, and what the runs measured, as the page plots them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import isfinite
from typing import Final

from pydantic import JsonValue

from sim_action.core import units
from sim_action.core.records import dataclass
from sim_action.core.wording import shortened
from sim_action.reports.escaping import one_line
from sim_action.reports.scenario_groups import nearest_expectation, relative_margin
from sim_action.results.outcome import ExpectationOutcome, Outcome
from sim_action.scenario.variations.expansion import labels

MIN_PLOTTED_RUNS: Final = 3
_MAX_CATEGORIES: Final = 20
_MAX_EXPECTATIONS: Final = 20
_MAX_TEXT: Final = 40
_DIGITS: Final = 6


@dataclass(frozen=True, slots=True)
class Parameter:
    """A varied key and its value in each run of a group."""

    label: str  # the shortest ending of the key that is unique in the group
    unit: str  # the SI unit of numbers
    # the values in SI; empty unless every value is a number of one unit. None: the run lacks the key.
    numbers: tuple[float | None, ...]
    texts: tuple[str, ...]  # the values as people read them

    @property
    def varies(self) -> bool:
        """Return True if two runs differ in it."""
        return len(set(self.texts)) > 1

    @property
    def categories(self) -> list[str]:
        """The different texts in call order; empty for numbers."""
        return [] if self.numbers else list(dict.fromkeys(text for text in self.texts if text))

    @property
    def is_plotted(self) -> bool:
        """Return True if it makes an axis of a plot."""
        return self.varies and len(self.categories) <= _MAX_CATEGORIES

    def packed(self) -> dict[str, JsonValue]:
        """Return the data of an axis; values of categories are their indices."""
        categories = self.categories
        indices = {text: float(index) for index, text in enumerate(categories)}
        values = self.numbers or tuple(indices.get(text) for text in self.texts)
        return {
            "name": self.label,
            "unit": self.unit,
            "categories": [shortened(text, _MAX_TEXT) for text in categories],
            "values": _rounded(values),
        }


def parameters(runs: Sequence[Outcome]) -> list[Parameter]:
    """Return the varied keys of runs, in the order of the scenario file."""
    named: list[Mapping[str, JsonValue]] = [{each.key: each.value for each in run.variation} for run in runs]
    keys = list(dict.fromkeys(key for values in named for key in values))
    called = labels(keys)
    return [_parameter(one_line(called[key]), [(key in values, values.get(key)) for values in named]) for key in keys]


def _parameter(label: str, stated: Sequence[tuple[bool, JsonValue]]) -> Parameter:
    found = [_quantity(value) if there else None for there, value in stated]
    known = {unit for each in found if each is not None for unit in (each[1],) if unit}
    is_numeric = all(each is not None for each, (there, _) in zip(found, stated, strict=True) if there)
    if not is_numeric or len(known) > 1:
        return Parameter(label, "", (), tuple(_text(value) if there else "" for there, value in stated))
    unit = next(iter(known), "")
    numbers = tuple(None if each is None else each[0] for each in found)
    return Parameter(label, unit, numbers, tuple("" if n is None else units.display(n, unit) for n in numbers))


def _quantity(value: JsonValue) -> tuple[float, str] | None:
    """Return a number with its SI unit; None for anything else."""
    try:
        return units.with_si_unit(value)
    except units.UnitError:
        return None


def _text(value: JsonValue) -> str:
    return one_line(value if isinstance(value, str) else str(value))


def has_plot(runs: Sequence[Outcome]) -> bool:
    """Return True if a plot of the parameters shows more than the list of runs: there are numbers that vary."""
    return bool(_axes(runs))


def _axes(runs: Sequence[Outcome]) -> list[Parameter]:
    if len(runs) < MIN_PLOTTED_RUNS:
        return []
    axes = [parameter for parameter in parameters(runs) if parameter.is_plotted]
    return axes if any(parameter.numbers for parameter in axes) else []


def sweep(runs: Sequence[Outcome], ids: Mapping[int, str], claim: float | None) -> dict[str, JsonValue] | None:
    """Return the data of the plots of a group; None if there is nothing to plot.

    `runs`: the runs of the group, in the order of the page; `ids`: `id()` of an outcome -> the element id of its
    article; `claim`: the rate that a gate claims, the middle of the colours of a share.
    """
    axes = _axes(runs)
    if not axes:
        return None
    return {
        "parameters": [parameter.packed() for parameter in axes],
        "series": [*_series(runs)],
        "statuses": [run.display_status for run in runs],
        "entries": [ids.get(id(run)) for run in runs],
        "claim": claim,
    }


def _series(runs: Sequence[Outcome]) -> Iterator[dict[str, JsonValue]]:
    """Yield the margin of the nearest expectation in per cent, then margin, value and time of each expectation."""
    yield {"name": "smallest margin", "unit": "%", "signed": True, "values": _rounded([_tightest(run) for run in runs])}
    places = max((len(run.expectations) for run in runs), default=0)
    for place in range(min(places, _MAX_EXPECTATIONS)):
        expected = [run.expectations[place] if place < len(run.expectations) else None for run in runs]
        first = next(each for each in expected if each is not None)
        name, unit = one_line(first.name), one_line(first.verdict.unit)
        for what, in_unit, value in _QUANTITIES:
            values = [None if each is None or each.verdict.cut_off else value(each) for each in expected]
            if len(set(values) - {None}) > 1:
                yield {
                    "name": f"{what}: {name}",
                    "unit": in_unit if in_unit is not None else unit,
                    "signed": what == "margin",
                    "values": _rounded(values),
                }


_QUANTITIES: Final[tuple[tuple[str, str | None, Callable[[ExpectationOutcome], float | None]], ...]] = (
    ("margin", None, lambda expected: expected.verdict.margin),
    ("measured", None, lambda expected: expected.verdict.measured),
    ("time", "s", lambda expected: expected.verdict.time),
)
"""The name of a quantity of an expectation, its unit unless it is that of the expectation, and its value."""


def _tightest(run: Outcome) -> float | None:
    """Return the relative margin of the nearest expectation in per cent, 0 for a met goal; None without any."""
    expected = nearest_expectation(run)
    if expected is None:
        return None
    is_met = expected.verdict.goal and expected.verdict.status == "passed"
    return 0.0 if is_met else 100.0 * relative_margin(expected)


def _rounded(values: Sequence[float | None]) -> list[JsonValue]:
    return [None if value is None or not isfinite(value) else float(f"{value:.{_DIGITS}g}") for value in values]
