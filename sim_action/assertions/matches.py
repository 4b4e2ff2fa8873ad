"""`matches: {trace: golden/x.csv, position: 2 cm, yaw: 3 deg}`: the run matches a golden trajectory."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from contextlib import suppress
from typing import Annotated, ClassVar, Final, Self

from pydantic import Field, model_validator
from typing_extensions import override

from sim_action.assertions import Assertion, Reference, shortened_title
from sim_action.assertions.monitors import Monitor, State
from sim_action.core import units
from sim_action.core.errors import FileProblem
from sim_action.core.field_types import (
    VARIATION,
    JointPosition,
    NamesFile,
    NonNegativeSeconds,
    PositiveHertz,
    PositiveMetres,
    PositiveRadians,
)
from sim_action.core.lazy_numpy import FloatArray, np
from sim_action.core.records import dataclass, replace
from sim_action.core.wording import shown
from sim_action.core.workspace import PathError
from sim_action.core.yaml_document import SpecProblems
from sim_action.robot.model.joint_selection import as_written, bare_angle, chosen, tolerance_problems
from sim_action.robot.model.robot_model import Joint
from sim_action.state.golden_trajectory import (
    RESOLUTION,
    Golden,
    GoldenError,
    GoldenForm,
    interpolated,
    rows_of,
    wrapped,
)
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.verdict import Judged, Mark, Polyline, Signal, Verdict
from sim_action.world.claims import COVERED_SHARE, HEADINGS, SINGLE_ROW, Ceiling, ClaimFinding, Findings, JudgedRun
from sim_action.world.scene import Scene

# A tolerance must be greater than the rounding of the file.
_MIN_TOLERANCE: Final = 2 * RESOLUTION
_MIN_YAW_TOLERANCE: Final = math.radians(0.02)
_MAX_DRAWN: Final = 2_000
_PLACEHOLDER: Final = re.compile(r"\$\w*")
_MAX_NAMED: Final = 3  # quantities named in a message
_SAME_TIME_S: Final = 1e-3  # golden times are rounded to milliseconds
_AT_REST: Final = 2e-3  # m and rad: less is no motion


def single_row(name: str, golden: Golden) -> str:
    """Return the problem of a golden file with one row."""
    when = f"at {golden.time[0]:g} s"
    return f"{name} has one row, {when}, so it compares no motion; record a longer run or window"


class Matches(Assertion):
    """The run equals an earlier one, the golden trajectory in the CSV file that `trace` names, within tolerances.

    `sim-action run --update-golden` writes the file. Commit it, and review its diff whenever it changes. The position
    of the base is compared at each time of the file, and so are heading and joints if they have a tolerance. It is an
    invariant that does not end the run, so the verdict names the first and the largest difference. `duration` is the
    allowed difference in length. With `after` and `before`, the file holds only the time between them.
    """

    key: ClassVar[str] = "matches"
    reference: ClassVar[Reference] = Reference(
        "logic",
        "invariant that does not end the run",
        "Each row of the file is within the tolerances, and both runs have the same length up to `duration`.",
        "A row differs by more than a tolerance, or one run is longer by more than `duration`.",
    )
    has_golden: ClassVar[bool] = True
    ceilings: ClassVar[tuple[Ceiling, ...]] = (
        Ceiling("yaw", "rad", HEADINGS),
        Ceiling(
            "position",
            "m",
            "two runs are never farther apart than twice physics.max_distance",
            lambda setting: 2 * setting.physics.max_distance,
        ),
    )

    trace: Annotated[
        str,
        NamesFile(),
        Field(
            min_length=5,
            pattern=r"\.csv$",
            description="path of the golden file; '$variation' stands for the values of the variation",
        ),
    ]
    position: Annotated[
        PositiveMetres | None, Field(ge=_MIN_TOLERANCE, description="tolerance of the base link's position, in space")
    ] = None
    yaw: Annotated[PositiveRadians | None, Field(ge=_MIN_YAW_TOLERANCE, description="tolerance of its heading")] = None
    joints: Annotated[
        dict[str, JointPosition], Field(description="joint name, or pattern such as '*_wheel_joint', to its tolerance")
    ] = Field(default_factory=dict)
    duration: Annotated[
        NonNegativeSeconds, Field(description="allowed difference between the lengths of both runs")
    ] = 0.2
    rate: Annotated[PositiveHertz, Field(le=1000, description="rows per second that --update-golden writes")] = 10.0

    @model_validator(mode="after")
    def _compares_something(self) -> Self:
        if self.position is None and self.yaw is None and not self.joints:
            raise ValueError("give a tolerance: 'position', 'yaw', 'joints' or several of them")
        for name, written in self.joints.items():
            if units.parse(written, units.ANGLE, units.LENGTH) < _MIN_TOLERANCE:
                raise ValueError(
                    f"the tolerance of '{name}' must be at least {_MIN_TOLERANCE:g}, found {shown(written)}"
                )
        unknown = [placeholder for placeholder in _PLACEHOLDER.findall(self.trace) if placeholder != VARIATION]
        if unknown:
            raise ValueError(f"unknown placeholder {unknown[0]} in the name of a file; only {VARIATION} is allowed")
        return self

    @property
    @override
    def title(self) -> str:
        limits = ((self.position, "m"), (self.yaw, "rad"))
        within = [units.display(value, unit) for value, unit in limits if value is not None]
        within += [f"{name} {as_written(tolerance)}" for name, tolerance in self.joints.items()]
        return shortened_title(f"{self.key} {self.trace} within {', '.join(within)}")

    reads_file: ClassVar[bool] = True

    def file_in(self, scene: Scene) -> str:
        """Return the golden file of a scene, relative to the scenario. Raises GoldenError."""
        return self.file_of(scene.variation)

    def file_of(self, variation: str) -> str:
        """Return the golden file of a variation as named in `Scene.variation`. Raises GoldenError."""
        if VARIATION in self.trace and not variation:
            raise GoldenError(f"the scenario has no variations, so {VARIATION} has no value; remove it from the name")
        return self.trace.replace(VARIATION, variation)

    def form_in(self, scene: Scene) -> GoldenForm:
        """Return the model and the joints that the golden file must have."""
        joints = dict.fromkeys(joint for joint, _ in self._tolerances(scene))
        return GoldenForm(scene.model.name, tuple((joint.name, joint.dimension("position").si) for joint in joints))

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield unknown joints, and a golden file that is missing, damaged or of another robot."""
        wrong = [(("joints", *path), why) for path, why in tolerance_problems(scene.model, self.joints)]
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

    @override
    def robot_claims(self, scene: Scene) -> Findings:
        for name, tolerance in self.joints.items():
            if (problem := bare_angle(scene.model, (name,), tolerance)) is not None:
                yield ClaimFinding("bare-angle", ("joints", name), problem)
        if scene.bolted and not self.joints:
            message = "only the base is compared, but it is fixed and never moves; add tolerances in 'joints'"
            yield ClaimFinding("fixed-base", (), message)
        if scene.workspace.updates_golden:
            return
        with suppress(GoldenError, PathError, ValueError):  # reported as problems
            golden = self.golden_in(scene)
            if len(golden.rows) < 2:
                yield ClaimFinding(SINGLE_ROW, ("trace",), single_row(self.file_in(scene), golden))

            elif not self._golden_moves(golden, scene):
                message = f"nothing that is compared moves in {self.file_in(scene)}, so any robot at rest matches"
                yield ClaimFinding("golden-at-rest", ("trace",), f"{message}; record a run that moves")

    def _golden_moves(self, golden: Golden, scene: Scene) -> bool:
        columns = [*((1, 2, 3) if self.position is not None else ()), *((4,) if self.yaw is not None else ())]
        columns += [5 + golden.form.joint_names.index(joint.name) for joint, _ in self._tolerances(scene)]
        return bool(np.ptp(golden.rows[:, columns], axis=0).max() > _AT_REST)

    @override
    def run_claims(self, run: JudgedRun) -> Findings:
        """Yield the share of the golden trajectory that was compared, if it is small."""
        judged = run.verdict.judged
        if run.scene.workspace.updates_golden or run.verdict.status != "passed" or judged is None:
            return
        golden = self.golden_in(run.scene)
        if self.position is not None:
            away = np.linalg.norm(golden.rows[:, 1:4] - run.trace.base_position_xyz[0], axis=1).max()
            yield from run.beyond_drive(self.position - float(away), "give a smaller tolerance", ("position",))
        first, last = float(golden.time[0]), float(golden.time[-1])
        seen = max(0.0, min(last, judged.last or 0.0) - max(first, judged.first or 0.0))
        if last > first and (share := seen / (last - first)) < COVERED_SHARE:
            message = (
                f"only {share:.0%} of {self.file_in(run.scene)} was compared: {seen:.4g} s of {last - first:.4g} s"
            )
            yield ClaimFinding("partly-compared", ("trace",), f"{message}; run for longer, or lower 'duration'")

    def golden_in(self, scene: Scene) -> Golden:
        """Return the golden trajectory of a scene. Raises GoldenError."""
        name, command = self.file_in(scene), f"'sim-action run --update-golden {scene.file}'"
        try:
            path = scene.workspace.file(name)
        except PathError as error:
            raise GoldenError(
                f"{error}; {command} writes it" if scene.workspace.may_make(name) else str(error)
            ) from None
        try:
            return Golden.read(path, self.form_in(scene))
        except OSError as error:
            raise GoldenError(f"{name} cannot be read: {error.strerror}") from None
        except GoldenError as error:
            raise GoldenError(f"{name}:{error}; {command} rewrites it") from None

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor. Raises FileProblem."""
        name = self.file_in(scene)
        if scene.workspace.updates_golden:
            return GoldenRewrite(name)
        try:
            golden = self.golden_in(scene)
        except GoldenError as error:
            raise FileProblem(str(error)) from None
        places = {joint: index for index, joint in enumerate(golden.form.joint_names)}
        asked = [] if self.position is None else [Tolerance("position", "m", self.position, (1, 2, 3))]
        asked += [] if self.yaw is None else [Tolerance("heading", "rad", self.yaw, (4,), turns=True)]
        asked += [
            Tolerance(joint.name, joint.dimension("position").si, limit, (5 + places[joint.name],))
            for joint, limit in self._tolerances(scene)
        ]
        return MatchesMonitor.at_start(name, golden, tuple(asked), self.duration, start)

    def marks(self, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        """See Assertion.marks. Returns the path of the golden run."""
        if scene.workspace.updates_golden:
            return ()
        rows = self.golden_in(scene).rows
        coarse = rows[: -1 : 1 + len(rows) // _MAX_DRAWN]
        places = tuple((x, y, z) for x, y, z in (*coarse[:, 1:4].tolist(), rows[-1, 1:4].tolist()))
        return (Polyline(places, tolerance=self.position or 0.0),)

    def _tolerances(self, scene: Scene) -> Iterator[tuple[Joint, float]]:
        """Yield each compared joint with its tolerance, in the order of the model."""
        for joint in scene.model.moving_joints:
            for name, written in self.joints.items():
                if joint in chosen(scene.model, (name,)):
                    yield joint, units.parse(written, joint.dimension("position"))


@dataclass(frozen=True, slots=True)
class Tolerance:
    """The tolerance of one quantity."""

    what: str  # "position", "heading" or the name of a joint
    unit: str
    limit: float
    columns: tuple[int, ...]  # the columns of a golden trajectory that make up the error
    turns: bool = False  # True for angles that repeat after a full turn

    def errors(self, rows: FloatArray, golden: FloatArray) -> FloatArray:
        """Return (N,) errors in `unit` between rows with the same times."""
        difference = rows[:, self.columns] - golden[:, self.columns]
        difference = wrapped(difference) if self.turns else difference
        return np.asarray(np.sqrt(np.square(difference).sum(axis=1)), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Deviation:
    """The fold of the error of one quantity."""

    tolerance: Tolerance
    largest: float = -1.0  # largest, time: the largest error and its sim time in s
    time: float = 0.0
    left: float | None = None  # sim time in s at which the error first exceeded the tolerance

    def observe(self, time: FloatArray, errors: FloatArray) -> Self:
        """Return the fold after these rows; `time` in s and `errors` in the unit of the tolerance, each (N,)."""
        later = self
        index = int(errors.argmax())
        if not errors[index] <= self.largest:  # NaN counts as an error
            later = replace(later, largest=float(errors[index]), time=float(time[index]))
        over = ~(errors <= self.tolerance.limit)
        if self.left is None and over.any():
            later = replace(later, left=float(time[int(over.argmax())]))
        return later

    @property
    def margin(self) -> float:
        """Margin of the largest error, in its unit."""
        return self.tolerance.limit - self.largest

    @property
    def text(self) -> str:
        """The largest error as text, such as "at most 5 cm off, at 3.40 s, limit 2 cm"."""
        tolerance = self.tolerance
        error, allowed = units.display_apart(self.largest, tolerance.limit, tolerance.unit)
        what = "" if tolerance.what == "position" else f" in {tolerance.what}"
        return f"at most {error} off{what}, at {self.time:.2f} s, limit {allowed}"


@dataclass(frozen=True, eq=False)
class MatchesMonitor(Monitor):
    """The comparison of a run with a golden trajectory. The run is interpolated linearly between steps."""

    name: str  # name of the golden file
    golden: Golden
    duration: float  # the allowed difference in length, in s
    before: FloatArray  # (1, 5 + J) the row of the last step
    deviations: tuple[Deviation, ...]
    next: int = 0  # index of the first golden row that has not been compared

    @classmethod
    def at_start(
        cls, name: str, golden: Golden, asked: tuple[Tolerance, ...], duration: float, start: Observation
    ) -> Self:
        """Return the monitor before the first step."""
        before = rows_of(Trace.of_observation(start), golden.form.joint_names)
        return cls(name, golden, duration, before, tuple(map(Deviation, asked)))

    state = State.HOLDS  # it never breaks, because the largest error may still come

    @override
    def begin(self, trace: Trace) -> Self:
        return replace(self, before=self._rows(trace)[-1:]) if len(trace) else self

    @override
    def observe(self, trace: Trace) -> Self:
        if not len(trace):
            return self
        rows = np.concatenate((self.before, self._rows(trace)))
        end = int(np.searchsorted(self.golden.time, rows[-1, 0], side="right"))
        later = replace(self, before=rows[-1:], next=max(self.next, end))
        due = self.golden.rows[self.next : end]
        due = due[due[:, 0] >= rows[0, 0]]
        if not len(due):
            return later
        ours = interpolated(rows, due[:, 0])
        deviations = tuple(one.observe(due[:, 0], one.tolerance.errors(ours, due)) for one in self.deviations)
        return replace(later, deviations=deviations)

    def signals(self, trace: Trace) -> tuple[Signal, ...]:
        """See Monitor.signals. Returns the errors at the golden times that the trace has."""
        rows = np.concatenate((self.before, self._rows(trace)))
        due = self.golden.rows
        due = due[(due[:, 0] >= rows[0, 0]) & (due[:, 0] <= rows[-1, 0])]
        after = np.clip(np.searchsorted(rows[:, 0], due[:, 0]), 1, len(rows) - 1)
        away = np.minimum(np.abs(rows[after, 0] - due[:, 0]), np.abs(rows[after - 1, 0] - due[:, 0]))
        due = due[away <= _SAME_TIME_S]
        if not len(due):
            return ()
        ours = interpolated(rows, due[:, 0])
        return tuple(
            Signal(f"{one.what} off the golden run", one.unit, due[:, 0], one.errors(ours, due), None, one.limit)
            for one in (deviation.tolerance for deviation in self.deviations)
        )

    def verdict(self) -> Verdict:
        """Return the verdict on the quantity that left its tolerance first, else on the smallest relative margin."""
        seen = [one for one in self.deviations if one.largest >= 0 or one.left is not None]
        if not seen:
            first, last = float(self.golden.time[0]), float(self.golden.time[-1])
            message = (
                f"never checked: {self.name} lasts from {first:g} s to {last:g} s, and no step of the check lies in "
                f"this time; move the window, or record {self.name} again from a longer run"
            )
            return Verdict(False, message=message, judged=Judged())
        left = sorted((one for one in seen if one.left is not None), key=lambda one: one.left or 0.0)
        lasting = self._lasting
        if not left and lasting is not None:
            return lasting
        worst = left[0] if left else min(seen, key=lambda one: one.margin / one.tolerance.limit)
        parts = [self._of_left(left)] if left else []
        parts += [one.text for one in left[:_MAX_NAMED] or (worst,)]
        message = "; ".join(parts if lasting is None else [*parts, lasting.message])
        limit, unit = worst.tolerance.limit, worst.tolerance.unit
        return Verdict(not left, worst.largest, limit, worst.margin, unit, worst.time, message)

    def _of_left(self, left: list[Deviation]) -> str:
        when = ", ".join(f"in {one.tolerance.what} at {one.left:.2f} s" for one in left[:_MAX_NAMED])
        return f"left {self.name} {when}{', and others' if len(left) > _MAX_NAMED else ''}"

    @property
    def _lasting(self) -> Verdict | None:
        """Return the verdict on a run that is too short or too long, else None."""
        end, golden_end = float(self.before[0, 0]), float(self.golden.time[-1])
        apart = abs(end - golden_end)
        # Golden times are rounded to milliseconds.
        if apart <= self.duration + 1e-3:
            return None
        which = "shorter" if end < golden_end else "longer"
        message = f"{apart:.2f} s {which} than {self.name}: ended at {end:.2f} s instead of {golden_end:.2f} s"
        return Verdict(False, apart, self.duration, self.duration - apart, "s", end, message)

    def _rows(self, trace: Trace) -> FloatArray:
        return rows_of(trace, self.golden.form.joint_names)


@dataclass(frozen=True, slots=True)
class GoldenRewrite(Monitor):
    """The monitor while a golden file is rewritten. It passes if there was at least one step."""

    name: str
    seen: bool = False

    state = State.HOLDS

    @override
    def observe(self, trace: Trace) -> Self:
        return replace(self, seen=self.seen or len(trace) > 0)

    @override
    def verdict(self) -> Verdict:
        message = f"{self.name} is written from this run" if self.seen else "no physics step to write"
        return Verdict(self.seen, None, None, None, "", None, message)
