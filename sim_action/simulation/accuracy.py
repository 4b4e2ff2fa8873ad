"""Notes of a run on the accuracy of its physics: energy, slip of wheels, unequal masses, and depth of contacts."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from typing_extensions import override

from sim_action.core import geometry, units
from sim_action.core.lazy_numpy import FloatArray
from sim_action.drives import Drive
from sim_action.drives.wheels import steering_joint, wheel
from sim_action.simulation.guards import Guard
from sim_action.state.observation import Clash, Overlap
from sim_action.state.trace import Trace
from sim_action.world import GROUND
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.robot.model.robot_model import RobotModel
    from sim_action.simulation.energy import EnergyWatch
LEAST_FRICTION: Final = 0.2  # with a smaller coefficient, wheels may slip in ordinary driving
_MAX_MASS_RATIO: Final = 100.0
_MAX_DEPTH_M: Final = 0.005
_LEAST_SLIDE: Final = 0.01  # the share of the rolled distance from which sliding is reported as slip
_LEAST_WAY_M: Final = 1e-3


class AccuracyWatch(Guard):
    """Collects the facts of a run on which the notes depend."""

    def __init__(self, scene: Scene, drive: Drive | None = None, springs: Collection[str] = ()) -> None:
        """Start without contacts. `springs`: the links whose depth is no error, see `links_with_springs`."""
        self._energy = _energy_watch(scene)
        self._slip = wheel_slip(scene, drive)
        self._masses: dict[str, float] = {body.name: body.mass for body in scene.world.objects if body.mass is not None}
        self._masses |= {name: actor.model.mass for name, actor in scene.actors.items() if not actor.bolted}
        self._robot = None if scene.bolted else scene.model.mass
        # A link that cannot move may be inside a body that cannot either.
        self._stuck = scene.bolted_links, {body.name for body in scene.world.objects if body.mass is None} | {GROUND}
        self._deepest: tuple[float, str, float] = (0.0, "", 0.0)
        self._springs = springs
        # The robot is one body, so its pairs consist of one name.
        self._unequal: dict[frozenset[str], tuple[str, float]] = {}

    @override
    def judged(self, trace: Trace, touching: Iterable[Overlap | Clash]) -> None:
        if self._energy is not None:
            self._energy.add(trace)
        if self._slip is not None:
            self._slip.add(trace)
        for touch in touching:
            time = float(trace.time[-1]) if len(trace) else 0.0
            if touch.depth > max(_MAX_DEPTH_M, self._deepest[0]) and not self._is_expected(touch):
                self._deepest = touch.depth, _names(touch), time
            one, other = (
                (self._robot, self._masses.get(touch.body))
                if isinstance(touch, Overlap)
                else (self._masses.get(touch.body), self._masses.get(touch.other))
            )
            if one and other and max(one, other) > _MAX_MASS_RATIO * min(one, other):
                pair = frozenset({touch.body} if isinstance(touch, Overlap) else {touch.body, touch.other})
                self._unequal.setdefault(pair, (_names(touch), max(one, other) / min(one, other)))

    def _is_expected(self, touch: Overlap | Clash) -> bool:
        """Return True for a spring that the model states, and for two sides that cannot give way."""
        links, bodies = self._stuck
        return isinstance(touch, Overlap) and (
            touch.link in self._springs or (touch.link in links and touch.body in bodies)
        )

    @override
    def notes(self, end: float) -> Iterator[str]:
        if self._energy is not None and (note := self._energy.note()) is not None:
            yield note
        if self._slip is not None:
            yield from self._slip.notes()
        for names, ratio in self._unequal.values():
            yield (
                f"{names} touched, and one has {ratio:,.0f} times the mass of the other: above {_MAX_MASS_RATIO:g}, "
                "contacts are inaccurate; compare with a run at twice the physics.rate"
            )
        depth, names, time = self._deepest
        if depth:
            yield (
                f"{names} overlapped by {units.display(depth, 'm', 3)} at {time:.2f} s: contacts are not accurate to "
                f"{units.display(_MAX_DEPTH_M, 'm')}; raise physics.rate, or check masses and speeds"
            )


def links_with_springs(model: RobotModel) -> frozenset[str]:
    """Return the names of the links for which the model states a contact stiffness."""
    return frozenset(link.name for link in model.links if link.surface.stiffness)


def _energy_watch(scene: Scene) -> EnergyWatch | None:
    if scene.acted_on:
        return None
    from sim_action.simulation.energy import EnergyWatch  # a usual run does without it

    return EnergyWatch.of(scene)


def wheel_slip(scene: Scene, drive: Drive | None) -> WheelSlip | None:
    """Return the measurement for a drive; None if its wheels have enough friction, or do not move the robot."""
    if drive is None or scene.bolted or drive.moves_base:
        return None
    motion, model = drive.wheel_motion(scene.model), scene.model
    gears = {} if motion is None else motion.gears
    # The axle of a steered wheel turns.
    gears = {name: gear for name, gear in gears.items() if steering_joint(model, name) is None}
    frictions = [model.links_by_name[model.joints_by_name[name].child].surface.friction for name in gears]
    lowest = min(frictions, default=1.0)
    if lowest >= LEAST_FRICTION:
        return None
    return WheelSlip(scene, gears, lowest)


def _names(touch: Overlap | Clash) -> str:
    if isinstance(touch, Overlap):
        return f"link '{touch.link}' and {_body(touch.body)}"
    return f"{_body(touch.body)} and {_body(touch.other)}"


def _body(name: str) -> str:
    return "the ground" if name == GROUND else f"body '{name}'"


class WheelSlip:
    """Measures how far the rims of wheels roll, and how far the wheels move and slide over the ground."""

    def __init__(self, scene: Scene, gears: Mapping[str, float], friction: float) -> None:
        """`gears`: the rolling distance in m for 1 rad of each wheel joint; `friction`: of the wheels, for the note."""
        self._friction, self._step_s = friction, 1 / scene.physics.rate
        self._wheels = [(wheel(scene.model, name), abs(gear)) for name, gear in gears.items()]
        self._rolled = self._moved = self._slid = 0.0

    def add(self, trace: Trace) -> None:
        """Add the next moments, at full rate."""
        columns = {name: place for place, name in enumerate(trace.joint_names)}
        for rolling_wheel, radius in self._wheels:
            speed = trace.joint_velocity[:, columns[rolling_wheel.joint]]
            arm = _turned(trace.base_orientation_xyzw, rolling_wheel.position_xyz)
            axle = _turned(trace.base_orientation_xyzw, rolling_wheel.axis_xyz)
            centre = trace.base_linear_xyz + np.cross(trace.base_angular_xyz, arm)
            turning = trace.base_angular_xyz + axle * speed[:, None]
            rim = centre + np.cross(turning, (0.0, 0.0, -radius))
            share = self._step_s / len(self._wheels)
            self._rolled += share * float(np.abs(radius * speed).sum())
            self._moved += share * float(np.hypot(centre[:, 0], centre[:, 1]).sum())
            self._slid += share * float(np.hypot(rim[:, 0], rim[:, 1]).sum())

    def notes(self) -> Iterator[str]:
        """Yield the notes after a run."""
        wheels = f"the model gives wheels a friction of {self._friction:g}"
        if max(self._rolled, self._moved) < _LEAST_WAY_M:
            yield f"{wheels}: they will slip if the robot accelerates or turns fast"
            return
        rolled, moved, slid = (units.display(way, "m", 3) for way in (self._rolled, self._moved, self._slid))
        way = f"rims rolled {rolled}, the wheels moved {moved} and slid {slid} over the ground (mean of the wheels)"
        slips = self._slid > _LEAST_SLIDE * max(self._rolled, self._moved)
        yield f"wheels {'slipped' if slips else 'did not slip'}: {way}; {wheels}"


def _turned(orientations: FloatArray, vector_xyz: geometry.Vector3) -> FloatArray:
    columns: Any = tuple(orientations.T)
    return np.column_stack(geometry.rotate(columns, vector_xyz))
