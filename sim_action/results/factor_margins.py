"""The margins of a scenario: how far each factor can move before the scenario fails, as `margins.json` has them."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field

from sim_action.core import units
from sim_action.core.errors import Location
from sim_action.core.field_types import FrozenModel
from sim_action.core.wording import counted, shortened
from sim_action.results.outcome import ExpectationOutcome, Measurement, NotNegative, Outcome, Spread
from sim_action.scenario.source import Variation
from sim_action.state.verdict import Judged, Verdict

MARGIN: Final = "margin"  # the assertion of the expectations that show margins
_MAX_REASON: Final = 300


class Margin(FrozenModel):
    """The margin of a factor in one direction."""

    factor: str  # its name, such as "friction"
    direction: Literal["down", "up"]  # the side of the nominal value
    unit: str  # the SI symbol of all values
    nominal: float  # the value in the scenario
    end: float  # the last value that was asked for
    passes: float  # the value farthest from the nominal one before the first failure
    fails: float | None = None  # the nearest value that failed; None if none did
    expectation: str = ""  # the expectation that fails first there; or empty
    reason: str = ""  # its message, or the reason why there is no verdict, or why nothing ran; or empty
    # the number of changes between passing and failing values that the scan has seen
    crossings: Annotated[int, Field(ge=0)] = 0
    runs: Annotated[int, Field(ge=0)] = 0  # the number of values that ran
    has_effect: bool = True  # True if a run of either direction moved in another way than that with the nominal value
    # the distance from the nominal value at which the scenario must still pass; None: none is demanded
    asked: NotNegative | None = None

    @property
    def threshold(self) -> float | None:
        """The middle of the values between which the scenario begins to fail."""
        return None if self.fails is None else (self.passes + self.fails) / 2

    @property
    def distance(self) -> float:
        """The distance from the nominal value to the threshold, or to the end of the range."""
        return abs((self.end if self.threshold is None else self.threshold) - self.nominal)

    @property
    def is_kept(self) -> bool:
        """True if no value failed within the distance that is demanded."""
        return self.asked is None or self.fails is None or abs(self.fails - self.nominal) > self.asked * (1 + 1e-9)

    def away(self, distance: float) -> str:
        """Return a distance from the nominal value in words, such as "11 % below 0.8"."""
        share = f"{100 * distance / abs(self.nominal):.3g} %" if self.nominal else ""
        amount = share or units.display(distance, self.unit)
        side = "below" if self.direction == "down" else "above"
        return f"{amount} {side} {units.display(self.nominal, self.unit)}"

    @property
    def message(self) -> str:
        """The margin in words."""
        if not self.runs:
            return f"cannot be varied: {self.reason}"
        if not self.has_effect:
            return f"has no effect: the robot moves alike in {counted(self.runs, 'run')} up to {self._value(self.end)}"
        if self.threshold is None:
            return f"never fails up to {self._value(self.end)}, {self.away(self.distance)}"
        again = f"; {self.crossings} changes between passing and failing were seen" if self.crossings > 1 else ""
        already = "fails from" if self.is_kept else "fails already at"
        asked = "" if self.is_kept or self.asked is None else f"; {self.away(self.asked)} was asked"
        first = f"{self.expectation}: {self.reason}" if self.expectation else self.reason
        return f"{already} {self._value(self.threshold)}, {self.away(self.distance)}{asked}{again}: {first}"

    def _value(self, value: float) -> str:
        return units.display(value, self.unit)

    def expected(self, location: Location) -> ExpectationOutcome:
        """Return the margin as an expectation, which passes if as much is left as is demanded."""
        asked = self.asked or 0.0
        sign = -1 if self.direction == "down" else 1
        verdict = Verdict(
            passed=self.is_kept,
            measured=self.threshold,
            limit=None if self.asked is None else self.nominal + sign * asked,
            margin=self.distance - asked if self.runs else None,
            unit=self.unit,
            message=shortened(self.message, _MAX_REASON),
            judged=None if self.has_effect and self.runs else Judged(),
        )
        spread = Spread(cause="bisection", status="passed" if self.is_kept else "failed", unit=self.unit)
        bounds = {} if self.fails is None else {"low": self._left(self.passes), "high": self._left(self.fails)}
        return ExpectationOutcome(
            name=f"{self.factor} {self.direction}",
            assertion=MARGIN,
            severity="error",
            location=location,
            verdict=verdict,
            unexercised="warn" if self.asked is None else "error",
            spreads=() if self.fails is None else (spread.model_copy(update=bounds),),
        )

    def _left(self, value: float) -> float:
        return abs(value - self.nominal) - (self.asked or 0.0)

    @property
    def share(self) -> float:
        """The part of the range, from 0 to 1, in which the scenario passes."""
        return self.distance / (abs(self.end - self.nominal) or 1.0)


class ScenarioMargins(FrozenModel):
    """The margins of a scenario."""

    name: str  # name, file, line, variation, engine: as in results.json
    file: str
    line: Annotated[int, Field(ge=1)] | None = None
    variation: Variation = ()
    engine: str | None = None
    reason: str = ""  # the reason why there are none; or empty
    margins: tuple[Margin, ...] = ()  # the margins of all factors

    def shown_by(self, outcome: Outcome) -> Outcome:
        """Return the outcome of the nominal run with the margins in place of its expectations, if there are any."""
        asked = {
            margin.factor: units.display(margin.asked, margin.unit)
            for margin in self.margins
            if margin.asked is not None
        }
        options = (f"--at-least={factor}={amount}" for factor, amount in asked.items())
        # Their files do not stay.
        outcome = outcome.model_copy(
            update={"trace": None, "replay": None, "call": ("sim-action", "margins", *options, self.file)}
        )
        if self.reason:
            return outcome.model_copy(update={"notes": (*outcome.notes, self.reason)})
        place = outcome.location or Location(self.file)
        places = {expected.name: expected.location for expected in outcome.expectations}
        ordered = sorted(self.margins, key=lambda margin: (margin.is_kept, margin.share))
        expectations = tuple(margin.expected(places.get(margin.expectation, place)) for margin in ordered)
        changed = outcome.model_copy(update={"expectations": expectations, "measurements": self._tornado()})
        return changed.model_copy(update={"status": changed.judged_status()})

    def _tornado(self) -> tuple[Measurement, ...]:
        """Return a bar for each factor, the one with the least margin first."""
        factors = dict.fromkeys(margin.factor for margin in self.margins if margin.has_effect and margin.runs)
        bars = [
            _bar(name, [margin for margin in self.margins if margin.factor == name and margin.runs]) for name in factors
        ]
        return tuple(bar for _, bar in sorted(bars, key=lambda pair: pair[0]))


def _bar(name: str, sides: list[Margin]) -> tuple[float, Measurement]:
    """Return the least part of a range that is left, and the bar of a factor: both of its directions."""
    shares = {margin.direction: min(1.0, margin.share) for margin in sides}
    ends = (
        f"passes up to {units.display(margin.end, margin.unit)}"
        if margin.threshold is None
        else f"fails at {units.display(margin.threshold, margin.unit)}"
        + (f" ({margin.expectation})" if margin.expectation else "")
        for margin in sides
    )
    least = min(sides, key=lambda margin: margin.share)
    return least.share, Measurement(
        name=f"margin of {name}",
        measured=least.distance,
        unit=least.unit,
        message=f"{name}: {', '.join(ends)}",
        left=(shares.get("down"), shares.get("up")),
    )


class Margins(FrozenModel):
    """The content of `margins.json`."""

    version: Literal[1] = 1
    sim_action: str
    runs: Annotated[int, Field(ge=0)]  # the number of runs in all
    scenarios: tuple[ScenarioMargins, ...]
