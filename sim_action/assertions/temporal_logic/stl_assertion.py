"""`stl: always (speed < 0.5 m/s)`: signal temporal logic over the motion of the robot."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from typing import Annotated, Any, ClassVar, Final, Self

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.assertions import Assertion, Reference, shortened_title
from sim_action.assertions.monitors import Monitor
from sim_action.assertions.temporal_logic import formula as stl
from sim_action.assertions.temporal_logic import formula_claims
from sim_action.assertions.temporal_logic.formula import Formula, Interval, comparisons
from sim_action.assertions.temporal_logic.formula_signals import (
    channels_of,
    dimension_problems,
    margin_unit,
    name_problems,
    sensor_problems,
)
from sim_action.assertions.temporal_logic.parser import parse, place
from sim_action.core.wording import shown
from sim_action.core.yaml_document import SpecProblems
from sim_action.state.observation import Observation
from sim_action.state.trace_records import Channels
from sim_action.world.claims import Findings, JudgedRun, Setting
from sim_action.world.scene import Scene

_STEP_ROUNDING: Final = 1e-6
_MAX_LOOKAHEAD_S: Final = 60.0  # an event judges a formula at each step, with the steps that it looks ahead


class Stl(Assertion):
    """A formula of signal temporal logic (STL) is true: a statement about signals over time.

    `speed < 0.5 m/s` compares signals: `time`, `x`, `y`, `z`, `roll`, `pitch`, `yaw`, `tilt`, `speed`, `turn_rate`,
    `travel` (as the assertion), and `position(JOINT)`, `velocity(JOINT)`, `effort(JOINT)`; with `+`, `-`, `*`,
    `abs(...)` and units. Comparisons are joined by `not`, `and`, `or`, `implies`, `always`, `eventually` and `until`.
    The last three may have an interval of sim time, relative to the time at which they are judged: `eventually[0 s, 2
    s] (...)`, `always[3 s, end] (...)`. The formula is judged at 0 s or `after`.

    Links, objects and sensors have signals, too. `LINK.z` has the names of the base's signals, except `time` and
    `travel`, in the world frame; `OBJECT.z` the same without `speed` and `turn_rate`. `distance(NAME, NAME)` is between
    the origins of two links or objects. `clearance`, `clearance(OBJECT)` and `clearance(LINK, OBJECT)` are distances of
    shapes; `force(OBJECT)` and `force(LINK, OBJECT)` the contact force, averaged over 50 ms; their object may be
    `ground`. `SENSOR.READING` is the last reading before a step, such as `bumper.force`, `scan.ranges.min` or
    `imu.angular_velocity_xyz.z`. An infinite range counts as 1e9 m. A name that is not a plain word stands in quotes:
    `'left-hand'.z`. The formula is judged from the first step at which all its signals are known.

    `always` is an invariant; `eventually` and `until` are goals; `and`, `or`, `not` and `implies` combine them. The
    margin is the robustness: the change of the signals that would change the truth. `<` and `<=` are the same.

    The run goes on until the end of every finite interval, unless the formula is decided before; `end` is the end of
    the run. If the run ends earlier, `always` judges the steps so far, and `eventually` and `until` count only steps
    with evidence: `eventually always[0 s, 2 s] a` needs 2 s in which `a` holds (rtamt cuts this interval instead). A
    formula whose inner interval has no end, such as `always (eventually a)`, or that looks ahead by more than 60 s, is
    judged at the end of the run.
    """

    key: ClassVar[str] = "stl"
    reference: ClassVar[Reference] = Reference(
        "logic",
        "depends on the formula",
        "The formula is true. An implication whose premise never held is true, and the [audit of "
        "claims](claims.md) adds a warning.",
        "The formula is false.",
        "The run ended before any step of an interval could be judged, before `after`, or before all "
        "signals were known.",
    )
    bare_value: ClassVar[str | None] = "formula"

    formula: Annotated[str, Field(min_length=1, description="the formula; may be the whole value")]

    @model_validator(mode="before")
    @classmethod
    def _takes_text_alone(cls, data: Any) -> Any:
        if isinstance(data, str):
            return {"formula": data}
        if not isinstance(data, dict):
            raise ValueError(f"expected a formula such as 'always (speed < 0.5 m/s)', found {shown(data)}")  # noqa: TRY004 - pydantic's
        return data

    @model_validator(mode="after")
    def _is_a_formula(self) -> Self:
        _ = self.parsed
        return self

    @cached_property
    def parsed(self) -> Formula:
        """The formula as a syntax tree."""
        return parse(self.formula)

    @property
    @override
    def awaited(self) -> Formula:
        whole = self.parsed
        return whole.formula if isinstance(whole, stl.Eventually) and whole.interval.end == math.inf else whole

    @override
    def waiting(self, span: float = 0.0, *, negated: bool = False) -> Assertion:
        lasting = f"always[0 s, {span!r} s] " if span and not negated else ""
        return Stl(formula=f"eventually {lasting}({'not ' * negated}({self.awaited}))")

    @property
    @override
    def moment_problem(self) -> str:
        if stl.horizon(self.awaited) <= _MAX_LOOKAHEAD_S:
            return ""
        most = f"a formula that looks ahead by more than {_MAX_LOOKAHEAD_S:g} s is decided at the end of the run only"
        return f"{most}; give its operators an interval, such as always[0 s, 2 s] (...)"

    @property
    @override
    def horizon(self) -> float:
        return stl.finite_horizon(self.parsed)

    @property
    @override
    def channels(self) -> Channels:
        return channels_of(self.parsed)

    @property
    @override
    def title(self) -> str:
        return shortened_title(f"{self.key} {' '.join(self.formula.split())}")

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield unknown names, comparisons of different dimensions, and intervals without a physics step."""
        problems = (*name_problems(self.parsed, scene), *dimension_problems(self.parsed, scene.model))
        yield from self._placed((*problems, *_empty(self.parsed, scene.physics.rate)))

    @override
    def sensor_problems(self, kinds: Mapping[str, str]) -> SpecProblems:
        yield from self._placed(sensor_problems(self.parsed, kinds))

    def _placed(self, problems: Iterable[tuple[int, str]]) -> SpecProblems:
        for at, message in problems:
            yield (), f"{message}; {place(self.formula, at)}"

    is_over_time: ClassVar[bool] = False  # a formula without "always" is about one moment

    @override
    def limits_motion(self, scene: Scene) -> bool:
        return formula_claims.asks_for_rest(self.parsed, scene)

    @override
    def judges_rest(self, scene: Scene) -> bool:
        return formula_claims.asks_for_rest(self.parsed, scene) or not formula_claims.is_about_motion(self.parsed)

    @override
    def meaning(self, scene: Scene) -> str:
        return self.formula

    @override
    def claims(self, setting: Setting) -> Findings:
        yield from formula_claims.audit_formula(self.formula, self.parsed, setting)

    @override
    def robot_claims(self, scene: Scene) -> Findings:
        yield from formula_claims.audit_formula_of_robot(self.formula, self.parsed, scene)

    @override
    def run_claims(self, run: JudgedRun) -> Findings:
        # A premise that never held is a finding of its own.
        if run.verdict.status == "passed" and not run.lacks_premise:
            yield from formula_claims.audit_forces(self.parsed, run.trace)
            yield from formula_claims.audit_distances(self.parsed, run)

    @override
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        from sim_action.assertions.temporal_logic.monitor import StlMonitor  # `validate` does without it

        units = {comparison: margin_unit(comparison, scene.model) for comparison in comparisons(self.parsed)}
        return StlMonitor.of(self.parsed, units, scene, start)


def _empty(formula: Formula, rate: float) -> Iterator[tuple[int, str]]:
    for part in stl.everything(formula):
        if isinstance(part, stl.Always | stl.Eventually | stl.Until) and _has_no_step(part.interval, rate):
            yield part.interval.at, f"no physics step (1 / {rate:g} s) is in the interval {part.interval}"


def _has_no_step(interval: Interval, rate: float) -> bool:
    first, last = interval.start * rate - _STEP_ROUNDING, interval.end * rate + _STEP_ROUNDING
    return math.isfinite(last) and math.ceil(first) > math.floor(last)
