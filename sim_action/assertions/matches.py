"""`matches: {trace: golden/x.csv, position: 2 cm, yaw: 3 deg}`: the run is the one that was committed."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, Self

from pydantic import Field, model_validator

from sim_action.assertions import Assertion, shortened_title
from sim_action.assertions.joint_selection import as_written, chosen, name_problem, unit_problem
from sim_action.assertions.monitors import Monitor, State
from sim_action.core import units
from sim_action.core.field_types import (
    JointPosition,
    NamesFile,
    NonNegativeSeconds,
    PositiveHertz,
    PositiveMetres,
    PositiveRadians,
)
from sim_action.core.messages import FirstFew, shown
from sim_action.core.workspace import PathError
from sim_action.core.yaml_errors import SpecProblems
from sim_action.robot.robot_model import Joint
from sim_action.state.golden_trajectory import RESOLUTION, GoldenError, GoldenForm
from sim_action.state.observation import Observation
from sim_action.state.verdict import Mark, Polyline, Signal, Verdict
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.golden_trajectory import Golden
    from sim_action.state.trace import FloatArray, Trace


# What is rounded must still match itself.
_FINEST: Final = 2 * RESOLUTION
_FINEST_YAW: Final = math.radians(0.02)
_MOST_DRAWN: Final = 2_000
_PLACEHOLDER: Final = re.compile(r"\$\w*")
_VARIATION: Final = "$variation"

# Of what left the golden trajectory, in a message.
_MOST_TOLD: Final = 3

# In s: golden times are written in milliseconds.
_SAME_MOMENT: Final = 1e-3


class Matches(Assertion):
    """The run is the same as one that was kept: its golden trajectory, a CSV file beside the scenario.

    `sim-action run --update-golden` writes that file, of the run as it is then: commit it, and look at its diff when it
    changes. From then on, at each of its moments, the base is held against where it was, and so are its heading and
    joints if they are asked for. It is an invariant, but ends no run, so that its verdict can tell when the run first
    left the golden one, and when it was farthest away. The run may be over a little earlier or later, as `duration`
    says. With `after` and `before`, the file holds the time between them. Physics rates and engines may differ, as far
    as the tolerances allow; variations share the file, unless `$variation` stands in its name.
    """

    key: ClassVar[str] = "matches"

    trace: Annotated[
        str,
        NamesFile(),
        Field(min_length=5, pattern=r"\.csv$", description="the golden file; $variation: its values, in the name"),
    ]
    position: Annotated[
        PositiveMetres | None, Field(ge=_FINEST, description="of the base link from where it was, in space")
    ] = None
    yaw: Annotated[PositiveRadians | None, Field(ge=_FINEST_YAW, description="of its heading")] = None
    joints: Annotated[
        dict[str, JointPosition],
        Field(description="name, or pattern such as '*_wheel_joint', to how far it may be off"),
    ] = Field(default_factory=dict)
    duration: Annotated[NonNegativeSeconds, Field(description="how much earlier or later the run may be over")] = 0.2
    rate: Annotated[PositiveHertz, Field(le=1000, description="rows in a second that --update-golden writes")] = 10.0

    @model_validator(mode="after")
    def _compares_something(self) -> Self:
        if self.position is None and self.yaw is None and not self.joints:
            raise ValueError("give 'position', 'yaw', 'joints' or several of them: how far the run may be off")
        for name, written in self.joints.items():
            if units.parse(written, units.ANGLE, units.LENGTH) < _FINEST:
                raise ValueError(f"the tolerance of '{name}' must be at least {_FINEST:g}, found {shown(written)}")
        unknown = [found for found in _PLACEHOLDER.findall(self.trace) if found != _VARIATION]
        if unknown:
            raise ValueError(f"{unknown[0]} stands for nothing in the name of a file; {_VARIATION} does")
        return self

    @property
    def title(self) -> str:
        """See Assertion.title."""
        limits = ((self.position, "m"), (self.yaw, "rad"))
        within = [units.display(value, unit) for value, unit in limits if value is not None]
        within += [f"{name} {as_written(tolerance)}" for name, tolerance in self.joints.items()]
        return shortened_title(f"{self.key} {self.trace} within {', '.join(within)}")

    @property
    def reads_file(self) -> bool:
        """See Assertion.reads_file."""
        return True

    def file_in(self, scene: Scene) -> str:
        """The golden file of a scene, as it is seen from the scenario. Raises GoldenError."""
        return self.file_of(scene.variation)

    def file_of(self, variation: str) -> str:
        """The golden file of a variation, as `Scene.variation` has it. Raises GoldenError."""
        if _VARIATION in self.trace and not variation:
            raise GoldenError(f"{_VARIATION} stands for nothing: the scenario has no variations; take it out")
        return self.trace.replace(_VARIATION, variation)

    def form_in(self, scene: Scene) -> GoldenForm:
        """What its golden file is of."""
        joints = dict.fromkeys(joint for joint, _ in self._tolerances(scene))
        return GoldenForm(scene.model.name, tuple((joint.name, joint.dimension("position").si) for joint in joints))

    def problems(self, scene: Scene) -> SpecProblems:
        """Joints that are not there, and a golden file that is missing, damaged, or of something else."""
        wrong = list(self._joint_problems(scene))
        yield from wrong
        if wrong:
            return
        try:
            name = self.file_in(scene)
            if scene.workspace.updates_golden:
                scene.workspace.new_file(name)
            else:
                self.golden_in(scene)
        except (GoldenError, PathError) as error:
            yield ("trace",), str(error)

    def golden_in(self, scene: Scene) -> Golden:
        """What the run is held against. Raises GoldenError."""
        from sim_action.state.golden_trajectory import Golden

        name, write = self.file_in(scene), f"'sim-action run --update-golden {scene.file}' writes it"
        try:
            path = scene.workspace.file(name)
        except PathError as error:
            raise GoldenError(f"{error}; {write}" if scene.workspace.may_make(name) else str(error)) from None
        try:
            return Golden.read(path, self.form_in(scene))
        except OSError as error:
            raise GoldenError(f"{name}: {error.strerror}") from None
        except GoldenError as error:
            raise GoldenError(f"{name}:{error}; {write} anew") from None

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        name = self.file_in(scene)
        if scene.workspace.updates_golden:
            return GoldenRewrite(name)
        golden = self.golden_in(scene)
        places = {joint: index for index, joint in enumerate(golden.form.joint_names)}
        asked = [] if self.position is None else [Tolerance("position", "m", self.position, (1, 2, 3))]
        asked += [] if self.yaw is None else [Tolerance("heading", "rad", self.yaw, (4,), turns=True)]
        asked += [
            Tolerance(joint.name, joint.dimension("position").si, limit, (5 + places[joint.name],))
            for joint, limit in self._tolerances(scene)
        ]
        return MatchesMonitor.at_start(name, golden, tuple(asked), self.duration, start)

    def marks(self, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        """See Assertion.marks: the way of the golden run."""
        if scene.workspace.updates_golden:
            return ()
        rows = self.golden_in(scene).rows
        coarse = rows[: -1 : 1 + len(rows) // _MOST_DRAWN]
        return (Polyline(tuple((x, y, z) for x, y, z in (*coarse[:, 1:4].tolist(), rows[-1, 1:4].tolist()))),)

    def _tolerances(self, scene: Scene) -> Iterator[tuple[Joint, float]]:
        """Each joint that is compared, in the order of the model, with how far it may be off."""
        for joint in scene.model.moving_joints:
            for name, written in self.joints.items():
                if joint in chosen(scene.model, (name,)):
                    yield joint, units.parse(written, joint.dimension("position"))

    def _joint_problems(self, scene: Scene) -> SpecProblems:
        hinted = FirstFew()
        for name, written in self.joints.items():
            if (trouble := name_problem(scene.model, name, hinted)) is not None:
                yield ("joints", name), trouble
            for joint in chosen(scene.model, (name,)):
                if (misfit := unit_problem(joint, "position", written)) is not None:
                    yield ("joints", name), misfit


@dataclass(frozen=True, slots=True)
class Tolerance:
    """How far something may be off.

    Attributes:
        what: "position", "heading", or the name of a joint.
        columns: of a golden trajectory, between which the distance is taken.
        turns: whether a whole turn is no difference.
    """

    what: str
    unit: str
    limit: float
    columns: tuple[int, ...]
    turns: bool = False

    def errors(self, rows: FloatArray, golden: FloatArray) -> FloatArray:
        """(N,) distances between rows of the same times, in `unit`."""
        import numpy as np

        from sim_action.state.golden_trajectory import wrapped

        difference = rows[:, self.columns] - golden[:, self.columns]
        difference = wrapped(difference) if self.turns else difference
        return np.asarray(np.sqrt(np.square(difference).sum(axis=1)), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Deviation:
    """How far something was off.

    Attributes:
        largest, time: the largest error, and the sim time in s at which it was.
        left: the sim time in s at which it was first more than is allowed.
    """

    tolerance: Tolerance
    largest: float = -1.0
    time: float = 0.0
    left: float | None = None

    def observe(self, time: FloatArray, errors: FloatArray) -> Self:
        """The fold after these moments."""
        later = self
        index = int(errors.argmax())
        if not errors[index] <= self.largest:  # what is not a number is off
            later = replace(later, largest=float(errors[index]), time=float(time[index]))
        over = ~(errors <= self.tolerance.limit)
        if self.left is None and over.any():
            later = replace(later, left=float(time[int(over.argmax())]))
        return later

    @property
    def margin(self) -> float:
        """Of the largest error, in its unit."""
        return self.tolerance.limit - self.largest

    @property
    def text(self) -> str:
        """Such as "5 cm off at 3.40 s, limit 2 cm", with what it is of."""
        tolerance = self.tolerance
        error, allowed = units.display_apart(self.largest, tolerance.limit, tolerance.unit)
        what = "" if tolerance.what == "position" else f" in {tolerance.what}"
        return f"at most {error} off{what}, at {self.time:.2f} s, limit {allowed}"


@dataclass(frozen=True, eq=False)
class MatchesMonitor:
    """Holds each moment of a golden trajectory against the run, which it takes to be straight between two steps.

    Attributes:
        name: of the golden file.
        duration: how much earlier or later the run may be over, in s.
        before: (1, 5 + J) the last moment seen.
        next: the first row of the golden trajectory that has not been compared.
    """

    is_momentary: ClassVar[bool] = False

    name: str
    golden: Golden
    duration: float
    before: FloatArray
    deviations: tuple[Deviation, ...]
    next: int = 0

    @classmethod
    def at_start(
        cls, name: str, golden: Golden, asked: tuple[Tolerance, ...], duration: float, start: Observation
    ) -> Self:
        """Before the first step."""
        from sim_action.state.golden_trajectory import rows_of
        from sim_action.state.trace import Trace

        before = rows_of(Trace.of_observation(start), golden.form.joint_names)
        return cls(name, golden, duration, before, tuple(map(Deviation, asked)))

    @property
    def state(self) -> State:
        """See Monitor.state: it ends no run, as the largest error may still come."""
        return State.HOLDS

    def begin(self, trace: Trace) -> Self:
        """See CumulativeMonitor.begin."""
        return replace(self, before=self._rows(trace)[-1:]) if len(trace) else self

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        import numpy as np

        if not len(trace):
            return self
        return self._compared(np.concatenate((self.before, self._rows(trace))))

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See PlottableMonitor.signals: how far off everything was, at the golden moments that the trace has."""
        import numpy as np

        from sim_action.state.golden_trajectory import interpolated

        rows = np.concatenate((self.before, self._rows(trace)))
        due = self.golden.rows
        due = due[(due[:, 0] >= rows[0, 0]) & (due[:, 0] <= rows[-1, 0])]
        after = np.clip(np.searchsorted(rows[:, 0], due[:, 0]), 1, len(rows) - 1)
        away = np.minimum(np.abs(rows[after, 0] - due[:, 0]), np.abs(rows[after - 1, 0] - due[:, 0]))
        due = due[away <= _SAME_MOMENT]
        if not len(due):
            return ()
        ours = interpolated(rows, due[:, 0])
        return tuple(
            Signal(f"{one.what} off the golden run", one.unit, due[:, 0], one.errors(ours, due), None, one.limit)
            for one in (deviation.tolerance for deviation in self.deviations)
        )

    def verdict(self) -> Verdict:
        """Of what left the golden trajectory, the first speaks; else of what came nearest to its limit."""
        seen = [one for one in self.deviations if one.largest >= 0 or one.left is not None]
        if not seen:
            return Verdict(False, None, None, None, "", None, f"no moment to compare with {self.name}")
        left = sorted((one for one in seen if one.left is not None), key=lambda one: one.left or 0.0)
        lasting = self._lasting
        if not left and lasting is not None:
            return lasting
        told = left[0] if left else min(seen, key=lambda one: one.margin / one.tolerance.limit)
        parts = [self._of_left(left)] if left else []
        parts += [one.text for one in left[:_MOST_TOLD] or (told,)]
        message = "; ".join(parts if lasting is None else [*parts, lasting.message])
        limit, unit = told.tolerance.limit, told.tolerance.unit
        return Verdict(not left, told.largest, limit, told.margin, unit, told.time, message)

    def _of_left(self, left: list[Deviation]) -> str:
        when = ", ".join(f"in {one.tolerance.what} at {one.left:.2f} s" for one in left[:_MOST_TOLD])
        return f"left {self.name} {when}{', and in more' if len(left) > _MOST_TOLD else ''}"

    @property
    def _lasting(self) -> Verdict | None:
        """On a run that was over too early or too late; None if it was not."""
        end, golden_end = float(self.before[0, 0]), float(self.golden.time[-1])
        apart = abs(end - golden_end)
        # What is written in whole milliseconds matches itself.
        if apart <= self.duration + 1e-3:
            return None
        which, how = ("shorter", "over at") if end < golden_end else ("longer", "still on at")
        message = f"{apart:.2f} s {which} than {self.name}: {how} {end:.2f} s, and that ends at {golden_end:.2f} s"
        return Verdict(False, apart, self.duration, self.duration - apart, "s", end, message)

    def _rows(self, trace: Trace) -> FloatArray:
        from sim_action.state.golden_trajectory import rows_of

        return rows_of(trace, self.golden.form.joint_names)

    def _compared(self, rows: FloatArray) -> Self:
        """The fold after rows that begin with the last moment seen."""
        import numpy as np

        from sim_action.state.golden_trajectory import interpolated

        end = int(np.searchsorted(self.golden.time, rows[-1, 0], side="right"))
        later = replace(self, before=rows[-1:], next=max(self.next, end))
        due = self.golden.rows[self.next : end]
        due = due[due[:, 0] >= rows[0, 0]]
        if not len(due):
            return later
        ours = interpolated(rows, due[:, 0])
        deviations = tuple(one.observe(due[:, 0], one.tolerance.errors(ours, due)) for one in self.deviations)
        return replace(later, deviations=deviations)


@dataclass(frozen=True, slots=True)
class GoldenRewrite:
    """Takes the place of a comparison where the golden file is written anew: any run matches itself."""

    name: str
    seen: bool = False

    @property
    def state(self) -> State:
        """See Monitor.state."""
        return State.HOLDS

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        return replace(self, seen=self.seen or len(trace) > 0)

    def verdict(self) -> Verdict:
        """See Monitor.verdict."""
        message = f"{self.name} is written from this run" if self.seen else "no moment to write"
        return Verdict(self.seen, None, None, None, "", None, message)
