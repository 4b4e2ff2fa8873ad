"""The mechanical energy of a robot that nothing drives or brakes: an integrator that changes it is too coarse.

Energy is computed from the trace at full rate and from the masses and inertias of the model. This is possible while
the robot touches nothing, no motor works, and no joint has damping or friction. Models in MJCF are not examined: their
joints may have springs and other forces.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final, Self

import numpy as np

from sim_action.core import geometry
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass
from sim_action.robot.model.kinematics import Frames, frames_of, link_motion
from sim_action.robot.model.robot_model import RobotModel
from sim_action.state.trace import Trace
from sim_action.world.parts import symmetric, turned_tensor
from sim_action.world.scene import Scene

_MAX_DRIFT: Final = 0.05
"""The greatest change of the energy that is not noted, as a share of the greatest kinetic energy."""

_MAX_WORK: Final = 0.01  # the greatest work of the motors, as the same share; a motor that holds a joint does not work

_LEAST_SPAN_S: Final = 0.5
"""In a shorter time, the error of the first steps is still a large share of the kinetic energy."""

_LEAST_ENERGY_J: Final = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class _Body:
    """The inertia of a link. Attributes: kg; m, in the link's frame; (3, 3) kg m^2 about its centre, in that frame."""

    mass: float
    centre: geometry.Vector3
    tensor: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class _Frame:
    """The frame of a link at T moments, world frame: its poses, its velocity (T, 3) and its turn rate (T, 3)."""

    poses: Frames
    linear: FloatArray
    angular: FloatArray

    def at(self, point_xyz: geometry.Vector3) -> tuple[FloatArray, FloatArray]:
        """Return position and velocity (T, 3) of a point of this frame, world frame."""
        arm = self.turned(point_xyz)
        return self.origin + arm, self.linear + np.cross(self.angular, arm)

    def turned(self, vector_xyz: geometry.Vector3) -> FloatArray:
        """Return a vector of this frame in the world frame, (T, 3)."""
        return np.column_stack(geometry.rotate(self.poses.orientation_xyzw, vector_xyz))

    @property
    def origin(self) -> FloatArray:
        """The positions of its origin, (T, 3)."""
        return np.column_stack(self.poses.position_xyz)


class Mechanics:
    """The links and joints of a robot, and their energy."""

    def __init__(self, model: RobotModel, gravity_xyz: geometry.Vector3) -> None:
        """`model`: not in MJCF."""
        self._model, self._gravity = model, np.array(gravity_xyz)
        self._bodies = _bodies(model)
        self._shapes = {
            link.name: [
                (shape.pose.position_xyz, _reach(shape.lower_xyz, shape.upper_xyz)) for shape in link.collisions
            ]
            for link in model.links
        }

    def frames(self, trace: Trace) -> dict[str, _Frame]:
        """Return the frame of each link."""
        motions = {name: link_motion(self._model, trace, name) for name in self._model.links_by_name}
        return {
            name: _Frame(frames_of(at.position_xyz, at.orientation_xyzw), at.linear_xyz, at.angular_xyz)
            for name, at in motions.items()
        }

    def energy(self, frames: Mapping[str, _Frame]) -> tuple[FloatArray, FloatArray]:
        """Return the kinetic and the potential energy in J, each (T,)."""
        moments = len(frames[self._model.root].linear)
        kinetic, potential = np.zeros(moments), np.zeros(moments)
        for name, body in self._bodies.items():
            frame = frames[name]
            position, velocity = frame.at(body.centre)
            angular: Any = tuple(frame.angular.T)
            turning = np.column_stack(geometry.rotate(geometry.conjugate(frame.poses.orientation_xyzw), angular))
            spin = np.einsum("ti,ij,tj->t", turning, body.tensor, turning)
            kinetic += (body.mass * np.square(velocity).sum(axis=1) + spin) / 2
            potential -= body.mass * (position @ self._gravity)
        return kinetic, potential

    def lowest(self, frames: Mapping[str, _Frame], fixed: frozenset[str]) -> FloatArray:
        """Return a lower bound (T,) in m on the height of all collision shapes except shapes of the links `fixed`."""
        lowest = np.full(len(frames[self._model.root].linear), np.inf)
        for name, shapes in self._shapes.items():
            for centre, reach in shapes if name not in fixed else ():
                lowest = np.minimum(lowest, frames[name].at(centre)[0][:, 2] - reach)
        return lowest


def _bodies(model: RobotModel) -> dict[str, _Body]:
    bodies = {}
    for link in model.links:
        if link.inertial is not None:
            pose = link.inertial.pose
            tensor = turned_tensor(symmetric(link.inertial.moments), pose.orientation_xyzw)
            bodies[link.name] = _Body(link.inertial.mass, pose.position_xyz, tensor)
    return bodies


def _reach(lower: geometry.Vector3, upper: geometry.Vector3) -> float:
    return math.hypot(*(max(abs(low), abs(high)) for low, high in zip(lower, upper, strict=True)))


class EnergyWatch:
    """Watches the energy of an undriven robot, from t = 0 until it may touch the ground."""

    def __init__(self, scene: Scene) -> None:
        self._mechanics = Mechanics(scene.model, scene.world.gravity_xyz)
        self._step_s = 1 / scene.physics.rate
        self._fixed = scene.bolted_links
        self._start: float | None = None
        self._is_over = False
        self._first_s = self._last_s = self._worst_s = 0.0
        self._kinetic = self._work = self._drift = 0.0

    @classmethod
    def of(cls, scene: Scene) -> Self | None:
        """Return the watch of a scene; None if something may drive, brake or touch the robot."""
        model = scene.model
        is_shaped = any(link.collisions for link in model.links)
        if scene.acted_on or model.mjcf or (is_shaped and (scene.world.objects or scene.world.patches)):
            return None
        if model.balls or any(joint.stiffness for joint in model.joints) or (scene.bolted and not model.moving_joints):
            return None
        if any(joint.mimic is not None for joint in model.joints) or any(
            joint.damping > 0 or joint.friction > 0 for joint in model.joints
        ):
            return None
        return cls(scene)

    def add(self, trace: Trace) -> None:
        """Add the next moments, at full rate."""
        if self._start is None and len(trace):
            # Most robots stand on the ground from the start.
            first = trace.rows(slice(1))
            self._is_over = bool(self._lowest(self._mechanics.frames(first))[0] <= 0)
        if self._is_over or not len(trace):
            return
        frames = self._mechanics.frames(trace)
        touching = np.flatnonzero(self._lowest(frames) <= 0)
        count = int(touching[0]) if touching.size else len(trace)
        self._is_over = bool(touching.size)
        if not count:
            return
        kinetic, potential = (values[:count] for values in self._mechanics.energy(frames))
        total = kinetic + potential
        if self._start is None:
            self._start, self._first_s = float(total[0]), float(trace.time[0])
        self._kinetic = max(self._kinetic, float(kinetic.max()))
        power = np.abs(trace.joint_effort * trace.joint_velocity)[:count].sum(axis=1)
        self._work += float(power.sum()) * self._step_s
        self._last_s = float(trace.time[count - 1])
        worst = int(np.abs(total - self._start).argmax())
        if abs(total[worst] - self._start) > abs(self._drift):
            self._drift, self._worst_s = float(total[worst] - self._start), float(trace.time[worst])

    def _lowest(self, frames: Mapping[str, _Frame]) -> FloatArray:
        return self._mechanics.lowest(frames, self._fixed)

    def note(self) -> str | None:
        """Return a note if the energy changed too much, else None."""
        kinetic = max(self._kinetic, _LEAST_ENERGY_J)
        if self._start is None or self._last_s - self._first_s < _LEAST_SPAN_S or self._work > _MAX_WORK * kinetic:
            return None
        if abs(self._drift) <= _MAX_DRIFT * kinetic:
            return None
        return (
            f"nothing drives or brakes the robot, but its mechanical energy changed by {self._drift:.3g} J until "
            f"{self._worst_s:.2f} s, and its kinetic energy was at most {kinetic:.3g} J: the physics steps are too "
            "long for its motion; raise physics.rate"
        )
