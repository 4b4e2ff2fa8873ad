"""The gate of a scenario: how often its samples have to pass, and how sure that has to be.

`gate:` stands next to `variations:`. Every combination of listed values has a gate of its own over the drawn samples.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Annotated, Final, Literal, Self

from pydantic import BeforeValidator, Field, ValidationError, WrapValidator, model_validator

from sim_action.core import statistics, units
from sim_action.core.errors import InvalidScenario, Location, Problem
from sim_action.core.field_types import FrozenModel, Quantity, spec_errors
from sim_action.core.records import dataclass
from sim_action.core.statistics import SequentialTest
from sim_action.core.wording import counted, did_you_mean, nearest, shown
from sim_action.core.yaml_document import Document, KeyPath
from sim_action.world.claims import LOW_GATE, allowed_rules

GATE: Final = "gate"  # the key of the gate
SAMPLE: Final = "sample"  # the label of a sample of a scenario that draws nothing, in the names of its runs
MAX_RUNS_OF_GATE: Final = 10_000
MAJORITY: Final = 0.5  # the share of runs that pass below which a gate needs permission to pass
_DIGITS: Final = 14
_LEAST_DIGITS_SHOWN: Final = 4


def _rate(stated: object, parsed: Callable[[object], float]) -> float:
    return _share(stated, parsed, "a rate lies between 0 % and 100 %, both excluded")


def _quantile_share(stated: object, parsed: Callable[[object], float]) -> float:
    return _share(stated, parsed, "a quantile lies between 0 % and 100 %, both excluded")


def _share(stated: object, parsed: Callable[[object], float], rule: str) -> float:
    share = _rounded(value := parsed(stated))
    if not 0 < share < 1:
        raise ValueError(f"{rule}; found {_as_found(stated, value)}")
    return share


def _confidence(stated: object, parsed: Callable[[object], float]) -> float:
    confidence = _rounded(value := parsed(stated))
    if not 0.5 <= confidence < 1:
        text = _as_found(stated, value)
        remedy = "" if "write" in text else "; use 95 %"
        raise ValueError(
            f"a confidence lies between 50 % and 100 %, and no number of runs gives 100 %; found {text}{remedy}"
        )
    return confidence


def _as_found(stated: object, value: float) -> str:
    percentage = percent(value)
    is_percentage = units.is_bare(stated) and 1 < value < 100
    return f"{value:g}, which is {percentage}; write '{value:g} %'" if is_percentage else percentage


def _rounded(share: float) -> float:
    return round(share, _DIGITS)


Rate = Annotated[float, Quantity((units.SHARE,)), WrapValidator(_rate)]
QuantileShare = Annotated[float, Quantity((units.SHARE,)), WrapValidator(_quantile_share)]
Confidence = Annotated[float, Quantity((units.SHARE,)), WrapValidator(_confidence)]
_CONFIDENCE_HELP: Final = "how sure the verdict has to be; default: 95 %"


class Passes(FrozenModel):
    """The smallest rate of runs that pass."""

    at_least: Annotated[Rate, Field(description="the rate that the runs have to show, such as 90 %")]
    confidence: Annotated[Confidence, Field(description=_CONFIDENCE_HELP)] = 0.95


class StopEarly(FrozenModel):
    """Two rates that a sequential test distinguishes; it stops as soon as it can."""

    reject: Annotated[Rate, Field(description="the rate of a robot that is not good enough")]
    accept: Annotated[Rate, Field(description="the rate of a robot that is good enough")]
    confidence: Annotated[Confidence, Field(description="how sure each decision has to be; default: 95 %")] = 0.95

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if not self.reject < self.accept:
            raise ValueError(
                "'reject' must be below 'accept'; found {} and {}".format(*percents_apart(self.reject, self.accept))
            )
        if self.confidence == 0.5:
            raise ValueError("a test that stops early needs a confidence above 50 %; use 95 %")
        return self

    @property
    def least_runs(self) -> int:
        """The least number of runs after which the test can accept; more than a gate may have if it never can."""
        test = SequentialTest(self.reject, self.accept, self.confidence, MAX_RUNS_OF_GATE)
        accepting = (runs for runs in range(1, MAX_RUNS_OF_GATE + 1) if test.boundaries(runs)[1])
        return next(accepting, MAX_RUNS_OF_GATE + 1)


class Quantile(FrozenModel):
    """A bound for a quantile of a measured value over the runs."""

    of: Annotated[
        str,
        Field(
            min_length=1,
            description="an expectation, by its name or the name of its assertion, and '.measured' or '.margin'; "
            "such as travel.measured",
        ),
    ]
    q: Annotated[QuantileShare, Field(description="the share of runs below the quantile, such as 5 %")]
    at_least: Annotated[float | str | None, Field(description="lower bound, with a unit; a number is SI")] = None
    at_most: Annotated[float | str | None, Field(description="upper bound, with a unit; a number is SI")] = None
    confidence: Annotated[Confidence, Field(description=_CONFIDENCE_HELP)] = 0.95

    @model_validator(mode="after")
    def _has_one_bound(self) -> Self:
        if (self.at_least is None) == (self.at_most is None):
            raise ValueError("must have either 'at_least' or 'at_most'")
        try:
            units.with_si_unit(self.bound)
        except units.UnitError:
            raise ValueError(f"{shown(self.bound)} is no quantity; write a number and a unit, such as 1.4 m") from None
        if self.expectation == self.of:
            raise ValueError(f"'of' ends with .measured or .margin, such as travel.measured; found {shown(self.of)}")
        return self

    @property
    def bound(self) -> float | str:
        """The stated bound."""
        stated = self.at_most if self.at_least is None else self.at_least
        assert stated is not None
        return stated

    @property
    def claim(self) -> Literal["at_least", "at_most"]:
        """The side of the stated bound."""
        return "at_least" if self.at_most is None else "at_most"

    @property
    def expectation(self) -> str:
        """The name of the expectation, or of its assertion."""
        return self.of.removesuffix(".measured").removesuffix(".margin")

    @property
    def share(self) -> float:
        """The share of runs that keep the bound if the claim holds."""
        return _rounded(1.0 - self.q) if self.at_most is None else self.q


def _listed(stated: object) -> object:
    if isinstance(stated, (dict, Quantile)):
        return (stated,)
    return tuple(stated) if isinstance(stated, list) else stated


class Errors(FrozenModel):
    """The largest number of runs without a verdict."""

    at_most: Annotated[int, Field(ge=0, description="errors, flaky and not exercised runs together; default: 0")] = 0


class Gate(FrozenModel):
    """The claims about all samples of a scenario."""

    passes: Annotated[Passes | None, Field(description="a fixed number of runs shows a rate")] = None
    stop_early: Annotated[
        StopEarly | None, Field(description="a sequential test between two rates; instead of 'passes'")
    ] = None
    quantile: Annotated[
        tuple[Quantile, ...],
        BeforeValidator(_listed, json_schema_input_type=Quantile | tuple[Quantile, ...]),
        Field(description="a bound for a quantile, or a list of several"),
    ] = ()
    errors: Annotated[Errors, Field(description="runs without a verdict; default: none")] = Errors.model_construct()
    runs: Annotated[
        int | None, Field(ge=1, le=MAX_RUNS_OF_GATE, description="number of samples; default: that of the draws")
    ] = None

    @model_validator(mode="after")
    def _claims_something(self) -> Self:
        if self.passes is not None and self.stop_early is not None:
            raise ValueError(
                "'passes' and 'stop_early' exclude each other: a test that stops early tells two rates apart, and "
                "shows no rate of 'at_least'; keep one of them; 'passes: null' removes that of a base file"
            )
        if self.passes is None and self.stop_early is None and not self.quantile:
            raise ValueError("must have 'passes', 'stop_early' or 'quantile'; such as passes: {at_least: 90 %}")
        if self.stop_early is not None and self.quantile:
            raise ValueError("a quantile needs all runs, and 'stop_early' leaves some out; use 'passes' instead")
        return self


class PlannedGate(FrozenModel):
    """A gate and the runs that it judges.

    Attributes:
        name: the name of the scenario with the listed values, for reports.
        file, line: the place of its outcomes.
        location: the place of the key `gate`.
        group: the name of the scenario.
        runs: the number of samples.
        may_be_low: True if it may pass although most of its runs fail.
    """

    name: str
    file: str
    line: Annotated[int, Field(ge=1)] | None = None
    location: Location
    group: str
    gate: Gate
    runs: Annotated[int, Field(ge=1, le=MAX_RUNS_OF_GATE)]
    may_be_low: bool = False


@dataclass(frozen=True, slots=True)
class GateOfScenario:
    """The gate that a scenario states, and the place of its key; `may_be_low`: see `PlannedGate`."""

    gate: Gate
    location: Location
    may_be_low: bool = False

    def planned(self, name: str, group: str, file: str, line: int | None, runs: int) -> PlannedGate:
        """Return the gate of so many runs of a scenario in `file`; see `PlannedGate`."""
        return PlannedGate(
            name=name,
            file=file,
            line=line,
            location=self.location,
            group=group,
            gate=self.gate,
            runs=runs,
            may_be_low=self.may_be_low,
        )


def refuse_misspelt(document: Document) -> None:
    """Raise InvalidScenario for a key such as `gates`: draws without it miss their number of samples."""
    keys = document.data if isinstance(document.data, dict) else ()
    misspelt = [key for key in keys if key != GATE and nearest(key, [GATE]) is not None]
    if misspelt and GATE not in keys:
        raise InvalidScenario([document.problem((key,), f"unknown key; did you mean '{GATE}'?") for key in misspelt])


class UnattainableGate(InvalidScenario):
    """A gate that no result of so many `runs` passes; `stated`: the gate, for a plan with more."""

    def __init__(self, problems: Iterable[Problem], stated: GateOfScenario, runs: int) -> None:
        super().__init__(problems)
        self.stated, self.runs = stated, runs


def stated_gate(document: Document) -> GateOfScenario | None:
    """Return the gate of a scenario; None if it has none. Raise InvalidScenario with all problems."""
    if not isinstance(document.data, dict) or GATE not in document.data:
        return None
    stated = document.data[GATE]
    try:
        gate = Gate.model_validate(stated)
    except ValidationError as error:
        key_problems = [
            document.problem(_written(path, stated), text) for path, text in spec_errors(Gate, stated, error)
        ]
        raise InvalidScenario(key_problems) from None
    problems = [
        document.problem(_written(("quantile", index), stated), problem)
        for index, quantile in enumerate(gate.quantile)
        if (problem := _unknown(quantile, document.data.get("expect"))) is not None
    ]
    may_be_low = LOW_GATE in allowed_rules(document.data)
    if not may_be_low:
        problems += [document.problem(_written(path, stated), text) for path, text in _low(gate)]
    if problems:
        raise InvalidScenario(problems)
    return GateOfScenario(gate, document.location((GATE,)), may_be_low)


def _low(gate: Gate) -> Iterator[tuple[KeyPath, str]]:
    """Yield the claims that hold although most of the runs fail."""
    rates: list[tuple[KeyPath, float, str]] = [
        (("quantile", index), claim.share, "a share") for index, claim in enumerate(gate.quantile)
    ]
    if gate.passes is not None:
        rates.append((("passes", "at_least"), gate.passes.at_least, "a rate"))
    if gate.stop_early is not None:
        rates.append((("stop_early", "accept"), gate.stop_early.accept, "a rate"))
    for path, rate, what in rates:
        if rate < MAJORITY:
            meant = f"write '{percent(rate * 100)}' if that is meant, or " if MAJORITY <= rate * 100 < 1 else ""
            accept = f"{meant}accept it with allow: [{LOW_GATE}]"
            yield path, f"{what} of {percent(rate)} allows most of the runs to fail; {accept} [{LOW_GATE}]"


def _written(path: KeyPath, stated: object) -> KeyPath:
    is_single = isinstance(stated, dict) and isinstance(stated.get("quantile"), dict)
    return (GATE, "quantile", *path[2:]) if is_single and path[:1] == ("quantile",) else (GATE, *path)


def _unknown(quantile: Quantile, expect: object) -> str | None:
    """Return the problem of a quantile that names no expectation, or several."""
    listed = expect if isinstance(expect, tuple) else ()
    # An assertion without keys may be written as its name alone.
    entries = [
        {expectation: {}} if isinstance(expectation, str) else expectation
        for expectation in listed
        if isinstance(expectation, (str, dict))
    ]
    called = [name for entry in entries if isinstance(name := entry.get("name"), str)]
    keys = [key for entry in entries for key in entry if key not in _OPTIONS]
    count = called.count(quantile.expectation) or keys.count(quantile.expectation)
    if count == 1:
        return None
    if count > 1:
        return f"{count} expectations are {shown(quantile.expectation)}; give the one that is meant a 'name'"
    names = [*called, *keys]
    return f"no expectation is {shown(quantile.expectation)}{did_you_mean(quantile.expectation, names)}"


_OPTIONS: Final = frozenset({"name", "after", "before", "for", "severity"})
"""The keys of an expectation besides its assertion."""


def runs_without_draws(document: Document, stated: GateOfScenario) -> int:
    """Return the number of samples of a scenario that draws nothing. Raises InvalidScenario."""
    if stated.gate.runs is None:
        message = "'runs' is missing: without drawn keys in 'variations', it is the number of samples"
        raise InvalidScenario([document.problem((GATE,), message)])
    return stated.gate.runs


def refuse_unfit(document: Document, stated: GateOfScenario, runs: int) -> None:
    """Raise InvalidScenario if no result of so many runs passes the gate."""
    if stated.gate.errors.at_most >= runs:
        message = f"all of the {runs} runs may be without a verdict; allow fewer"
        raise InvalidScenario([document.problem((GATE, "errors", "at_most"), message)])
    assert isinstance(document.data, dict)
    # The file that has to change may be a base of several scenarios.
    scenario = "" if stated.location.file == document.file else f"the scenario {document.file}: "
    problems = [
        document.problem(_written(path, document.data[GATE]), f"{scenario}{text}")
        for path, text in _unattainable(stated.gate, runs)
    ]
    if problems:
        raise UnattainableGate(problems, stated, runs)


def _unattainable(gate: Gate, runs: int) -> Iterator[tuple[KeyPath, str]]:
    if (passes := gate.passes) is not None:
        needed = statistics.runs_needed(passes.at_least, passes.confidence)
        if runs < needed:
            yield ("passes",), _too_few(runs, needed, f"a rate of {percent(passes.at_least)}", passes.confidence)
    if (test := gate.stop_early) is not None:
        needed = test.least_runs
        if runs < needed:
            rates = f"{percent(test.accept)} against {percent(test.reject)}"
            yield ("stop_early",), _too_few(runs, needed, rates, test.confidence)
    for index, quantile in enumerate(gate.quantile):
        needed = statistics.runs_needed_for_quantile(quantile.q, quantile.confidence, quantile.claim)
        if runs < needed:
            what = f"a bound for the {percent(quantile.q)} quantile"
            yield ("quantile", index), _too_few(runs, needed, what, quantile.confidence)


def _too_few(runs: int, needed: int, what: str, confidence: float) -> str:
    cannot = f"{counted(runs, 'run')} cannot show {what} with {percent(confidence)} confidence, whatever they give"
    if needed > MAX_RUNS_OF_GATE:
        return f"{cannot}; it needs more than {MAX_RUNS_OF_GATE:,}, the most that a gate may have: claim less"
    return f"{cannot}; it needs {needed}: write 'runs: {needed}' or more"


def percent(share: float) -> str:
    """Return a share for people, such as "90 %"; one below 1 is never "100 %"."""
    return percents_apart(share)[0]


def percents_apart(*shares: float) -> tuple[str, ...]:
    """Return shares with as many digits, four or more, as make different ones differ, also from 100 %."""
    texts: tuple[str, ...] = ()
    for digits in range(_LEAST_DIGITS_SHOWN, units.ALL_DIGITS + 1):
        texts = tuple(units.display(share * 100, "%", digits) for share in shares)
        if len({*texts, "100 %"}) == len({*shares, 1.0}):
            break
    return texts
