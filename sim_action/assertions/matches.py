"""`matches: {trace: golden/x.csv, position: 2 cm, yaw: 3 deg}`: the run is the one that was committed."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, Self

from pydantic import Field, model_validator

from sim_action.assertions import Assertion, Monitor
from sim_action.assertions.combined import short
from sim_action.assertions.joint_choice import as_written, chosen, name_problem, unit_problem
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
from sim_action.state.verdict import Mark, Polyline
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.golden_trajectory import Golden

# What is rounded must still match itself.
_FINEST: Final = 2 * RESOLUTION
_FINEST_YAW: Final = math.radians(0.02)
_MOST_DRAWN: Final = 2_000
_PLACEHOLDER: Final = re.compile(r"\$\w*")
_VARIATION: Final = "$variation"


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
        return short(f"{self.key} {self.trace} within {', '.join(within)}")

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
        from sim_action.assertions.matches_monitor import MatchesMonitor, Renewal, Tolerance

        name = self.file_in(scene)
        if scene.workspace.updates_golden:
            return Renewal(name)
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
