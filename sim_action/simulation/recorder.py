"""The recorder of a run: the stored trace, 30 moments per second for replays, and every step for comparisons."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_action.core.geometry import Twist
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import replace
from sim_action.robot.model.kinematics import frames_of, link_frames
from sim_action.scenario.model import Agreement, Scenario
from sim_action.sensors import ReadingLog
from sim_action.state.command import Command, JointTargets, LinkWrench
from sim_action.state.observation import Contact, Observation
from sim_action.state.timeline import TimeMark
from sim_action.state.trace import Trace
from sim_action.state.trace_records import (
    FRAME_RATE,
    Channels,
    CommandedTwists,
    CommandedValues,
    SensorRecord,
    frame_stride,
)
from sim_action.state.trace_storage import MotionRecord
from sim_action.world import GROUND, World
from sim_action.world.scene import Scene

_MAX_FRAMES: Final = 200_000  # a run of hours must still fit into memory


TWIST_NAMES: Final = ("linear x", "linear y", "linear z", "angular x", "angular y", "angular z")
"""The names of the components of a commanded twist, in the frame of the base."""

JOINT_TARGETS: Final = ("position", "velocity", "effort")  # the kinds of targets of joints, as in `JointTargets`


class RunRecorder:
    """The recorded data of a run; after a failure, it holds the data up to the failure.

    Attributes:
        start: the settled state at t = 0; None before the start.
        readings: the readings of all open sensors by name, for a replay; None without one. The last ones may be later
            than the end of the run.
        marks: the marks of the timeline, in the order of time; empty before the end.
        scenario: the scenario, with the times of the events that happened.
    """

    def __init__(
        self, scenario: Scenario, *, filmed: bool = False, recorded: bool = False, compared: bool = False
    ) -> None:
        """Prepare the recorder; `filmed`: for a replay; `recorded`: for recordings; `compared`: for a comparison."""
        self.scenario = scenario
        self._steps = EveryStep(scenario) if compared else None
        self._judges_contacts = any(expected.channels.contacts for expected in scenario.expect)
        self._contacts: list[Contact] = []
        self._rate = scenario.physics.rate
        self._stride = _stride(self._rate, scenario.trace_rate)
        often = math.ceil(scenario.time_limit * FRAME_RATE / _MAX_FRAMES)
        self._film_stride = often * frame_stride(self._rate)
        self._filmed = filmed or recorded
        self._twists: list[tuple[float, Twist]] | None = [] if recorded else None
        self._commanded: dict[str, list[tuple[int, dict[str, float]]]] = {}
        self._wrenches: list[tuple[float, tuple[LinkWrench, ...]]] = []
        self._kept: list[Trace] = []
        self._film: list[Trace] = []
        self.start: Observation | None = None
        self.marks: tuple[TimeMark, ...] = ()
        # Name of each other robot -> its trace in the film.
        self.actors: Mapping[str, Trace] = {}
        self.readings: dict[str, ReadingLog] | None = {} if filmed else None

    @property
    def is_filmed(self) -> bool:
        """True if a replay, or recordings, are asked for."""
        return self._filmed

    def channels(self, world: World) -> Channels:
        """Return the channels that only a replay needs."""
        if not self._filmed:
            return Channels()
        return Channels(contacts=True, bodies=frozenset(moving_bodies(world)))

    def begin(self, start: Observation, bodies: FloatArray | None = None, opening: Trace | None = None) -> None:
        """Record the moment at t = 0.

        `bodies`: the poses (M, 7) of the bodies with a mass. `opening`: this moment with
        its records; its contacts are not stored.
        """
        self.start = start
        first = Trace.of_observation(start)
        seen = first if opening is None else replace(opening, contacts=())
        self._kept.append(seen)
        if self._steps is not None:
            self._steps.add(seen, None if bodies is None else bodies[None])
        if self._filmed:
            self._film.append(seen)

    def add(
        self, seen: Trace, *, judged: Mapping[str, SensorRecord], is_last: bool, bodies: FloatArray | None = None
    ) -> None:
        """Record the moments since the last call; `is_last` keeps the very last one.

        `judged`: the readings of sensors that assertions use, even if the trace does not keep them.
        `bodies`: the poses (T, M, 7) of the bodies with a mass; rows beyond the end of `seen` are ignored.
        """
        if self._steps is not None:
            self._steps.add(seen, bodies)
        rows = self._rows(seen, self._stride, is_last=is_last)
        # Contacts that only the replay needs are not stored in the trace.
        contacts = seen.contacts if self._judges_contacts else ()
        self._kept.append(replace(seen.rows(rows), contacts=contacts))
        if self._filmed:
            # The ground is no body of a replay.
            self._contacts += (contact for contact in seen.contacts if contact.body != GROUND)
            rows = self._rows(seen, self._film_stride, is_last=is_last)
            # Images are too large to be kept.
            sensors = {
                name: record for name, record in judged.items() if name in seen.sensors or record.kind != "camera"
            }
            # The contacts of all steps are joined at the end.
            self._film.append(replace(seen.rows(rows), contacts=(), sensors=sensors))

    def command(self, time: float, command: Command) -> None:
        """Record a command at a time in s."""
        if isinstance(command, Twist):
            if self._twists is not None:
                self._twists.append((time, command))
            if self._filmed:
                self._hold("base", time, zip(TWIST_NAMES, (*command.linear_xyz, *command.angular_xyz), strict=True))
        elif isinstance(command, JointTargets) and self._filmed:
            self._aim(time, command)
            if command.wrenches is not None:
                self._hold("wrench", time, summed_wrenches(command.wrenches).items())
                if self._twists is not None:
                    self._wrenches.append((time, command.wrenches))

    def _aim(self, time: float, command: JointTargets) -> None:
        names = command.names()
        for kind in JOINT_TARGETS:
            targets: Mapping[str, float] = getattr(command, kind)
            if targets or kind in self._commanded:
                # A joint with another kind of target has no target of this kind any more.
                self._hold(kind, time, (dict.fromkeys(names, math.nan) | dict(targets)).items())

    def _hold(self, kind: str, time: float, values: Iterable[tuple[str, float]]) -> None:
        """Record commanded values for the next moment of the film; later ones for the same moment replace them."""
        moment = -(-round(time * self._rate) // self._film_stride)
        held = self._commanded.setdefault(kind, [])
        if not held or held[-1][0] != moment:
            held.append((moment, {}))
        held[-1][1].update(values)

    def twists(self) -> CommandedTwists:
        """Return the twist commands, if recordings are asked for."""
        return CommandedTwists.of(self._twists or ())

    def wrenches(self) -> Sequence[tuple[float, tuple[LinkWrench, ...]]]:
        """Return the times in s at which wrenches changed, with all wrenches from then on; empty without recordings."""
        return self._wrenches

    def commanded(self) -> Mapping[str, CommandedValues]:
        """Return what was commanded in the film: "base", "wrench", and by joint "position", "velocity" and "effort"."""
        period = self._film_stride / self._rate
        return {
            kind: CommandedValues.of([(moment * period, values) for moment, values in held])
            for kind, held in self._commanded.items()
        }

    def trace(self) -> Trace | None:
        """Return the trace at the rate of the scenario; None before the start."""
        return Trace.concatenate(self._kept) if self._kept else None

    def film(self) -> Trace | None:
        """Return the trace at 30 Hz with all channels; None before the start, or if it is not asked for."""
        if not self._film:
            return None
        return replace(Trace.concatenate(self._film), contacts=tuple(self._contacts))

    def motion(self, scene: Scene) -> MotionRecord | None:
        """Return the motion at every step; None before the start, or if it is not asked for."""
        return self._steps.record(scene) if self._steps is not None and self.start is not None else None

    def _rows(self, seen: Trace, stride: int, *, is_last: bool) -> NDArray[np.intp]:
        """Return the indices of every stride-th step, counted from t = 0."""
        first_step, last = round(seen.time[0] * self._rate), len(seen) - 1
        rows = np.arange(-first_step % stride, len(seen), stride)
        # numpy's own union imports masked arrays, which takes longer than most replays.
        return np.append(rows, last) if is_last and last not in rows[-1:] else rows


class EveryStep:
    """The motion of a run at every physics step, for the comparison with another run."""

    def __init__(self, scenario: Scenario) -> None:
        """Prepare the record of the links and bodies that `agreement` names."""
        named = scenario.agreement or Agreement.model_construct()
        heavy = [body.name for body in scenario.world.objects if body.mass is not None]
        self._links = tuple(named.links)
        self._bodies = {name: heavy.index(name) for name in named.bodies if name in heavy}
        # Other robots, whose poses come with the trace.
        self._actors: dict[str, list[FloatArray]] = {name: [] for name in named.bodies if name not in heavy}
        self._joint_names: tuple[str, ...] = ()
        self._robot: list[FloatArray] = []
        self._poses: list[FloatArray] = []

    def add(self, seen: Trace, bodies: FloatArray | None) -> None:
        """Add the moments since the last call; `bodies`: the poses (T, M, 7) of the bodies with a mass."""
        self._joint_names = seen.joint_names
        # The time, the pose of the base, and the joints.
        self._robot.append(np.concatenate((seen.state[:, :8], seen.joint_position), axis=1))
        if self._bodies and bodies is not None:
            self._poses.append(bodies[: len(seen), list(self._bodies.values())])
        for name, poses in self._actors.items():
            record = seen.objects[name]
            poses.append(np.column_stack((record.position_xyz, record.orientation_xyzw)))

    def record(self, scene: Scene) -> MotionRecord:
        """Return the record of all moments; the poses of links follow from the base and the joints."""
        rows = np.concatenate(self._robot)
        joints = {name: rows[:, 8 + column] for column, name in enumerate(self._joint_names)}
        poses = np.concatenate(self._poses) if self._poses else np.empty((len(rows), len(self._bodies), 7))
        return MotionRecord(
            time=rows[:, 0],
            base=rows[:, 1:8],
            joints=joints,
            units={name: scene.model.joints_by_name[name].dimension("position").si for name in joints},
            links=self._link_poses(scene, rows),
            bodies={name: poses[:, number] for number, name in enumerate(self._bodies)}
            | {name: np.concatenate(pieces) for name, pieces in self._actors.items()},
            bolted=scene.bolted,
        )

    def _link_poses(self, scene: Scene, rows: FloatArray) -> dict[str, FloatArray]:
        if not self._links:
            return {}
        frames = link_frames(scene.model, frames_of(rows[:, 1:4], rows[:, 4:8]), rows[:, 8:])
        return {
            name: np.column_stack([*frames[name].position_xyz, *frames[name].orientation_xyzw]) for name in self._links
        }


def summed_wrenches(wrenches: Iterable[LinkWrench]) -> dict[str, float]:
    """Return the components of the forces in N and torques in N m on each link, each in the frame of its wrench."""
    components: dict[str, float] = {}
    for wrench in wrenches:
        for kind, vector in (("force", wrench.force_xyz), ("torque", wrench.torque_xyz)):
            for axis, value in zip("xyz", vector, strict=True):
                name = f"{kind} on {wrench.link} {axis}"
                components[name] = components.get(name, 0.0) + value
    return components


def moving_bodies(world: World) -> list[str]:
    """Return the names of the bodies that can move."""
    return [body.name for body in world.objects if body.mass is not None or body.path]


def _stride(rate: float, target_rate: float) -> int:
    return max(1, round(rate / target_rate))
