"""Scenes drawn at random, on both engines, against oracles of energy, contacts, impulses and repetition.

    python -m tests.drawn_scenes --count 10000 --seed 1 [--engine mujoco]

A scene is a body that is the robot, let fall from a drawn pose among loose and fixed bodies. Its oracles:

- energy: no step adds energy, and until its first contact the robot falls as the integrator has it;
- contacts: each lies on the surfaces of both bodies, its force does not pull, and whatever overlaps is in contact;
- impulses: a change of momentum is that of the weight and of the contacts, with friction within its coefficient;
- repetition: the same scene gives the same bits again.

The same seed gives the same scenes. Exit code 1 if an oracle does not hold; each such scene is printed.
"""

from __future__ import annotations

import argparse
import hashlib
import itertools
import math
import random
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sim_action.core.field_types import Placement
from sim_action.core.geometry import Vector3
from sim_action.core.workspace import Workspace
from sim_action.engines import ENGINES, installed
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.urdf import read_urdf
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels
from sim_action.world import Physics, World
from sim_action.world.scene import Scene
from tests.traces import rotation_matrices

FloatArray = NDArray[np.float64]
_GRAVITY: Final = 9.80665
_LINK: Final = "it"
_SURFACE_M: Final = {"pybullet": 1e-2, "mujoco": 1e-3}
"""Contacts are at most this far from both surfaces, besides the depth of their overlap and the gap that a step closes.

PyBullet lists a first touch with its place on one of the bodies, one step before the other one is there. It then keeps
a point on each, also with a force, while they turn and slide: the two drift apart (seen: 6 mm), up to 20 mm.
"""
_FALL_M: Final = 1e-5
_OVERLAP_M: Final = 3e-3  # bodies that overlap by more than this are in contact


@dataclass(frozen=True)
class Solid:
    """A homogeneous body."""

    name: str
    kind: str  # "box", "sphere" or "cylinder"
    size: tuple[float, ...]  # half sizes in m of a box; the radius; radius and half height
    mass: float | None  # kg; None: it is fixed
    friction: float
    position: Vector3  # position, orientation: its start, world frame
    rpy: Vector3

    @property
    def reach(self) -> float:
        """The radius in m of a sphere around it."""
        return math.hypot(*self.size)

    @property
    def moments(self) -> Vector3:
        """The moments of inertia in kg m^2 about its axes."""
        mass = self.mass or 0.0
        if self.kind == "box":
            x, y, z = (side**2 for side in self.size)
            return (mass * (y + z) / 3, mass * (x + z) / 3, mass * (x + y) / 3)
        if self.kind == "sphere":
            return (0.4 * mass * self.size[0] ** 2,) * 3
        radius, half = self.size
        across = mass * (radius**2 / 4 + half**2 / 3)
        return (across, across, mass * radius**2 / 2)

    def outside(self, points: FloatArray) -> FloatArray:
        """Return the distances in m of points (N, 3) of its frame from its surface; negative inside."""
        if self.kind == "sphere":
            return _lengths(points) - self.size[0]
        if self.kind == "box":
            beyond = np.abs(points) - np.array(self.size)
        else:
            flat = np.hypot(points[:, 0], points[:, 1]) - self.size[0]
            beyond = np.column_stack([flat, np.abs(points[:, 2]) - self.size[1]])
        inside: FloatArray = np.minimum(beyond.max(axis=1), 0)
        return _lengths(np.maximum(beyond, 0)) + inside

    def below(self, rotation: FloatArray) -> FloatArray:
        """Return how far in m it reaches below its centre, for rotations (N, 3, 3)."""
        down: FloatArray = np.abs(rotation[:, 2, :])
        if self.kind == "sphere":
            return np.full(len(down), self.size[0])
        if self.kind == "box":
            return down @ np.array(self.size, dtype=np.float64)
        radius, half = self.size
        return radius * _lengths(down[:, :2]) + half * down[:, 2]

    @property
    def urdf_shape(self) -> str:
        """The shape as an element of URDF."""
        if self.kind == "box":
            return f'<box size="{" ".join(repr(2 * side) for side in self.size)}"/>'
        if self.kind == "sphere":
            return f'<sphere radius="{self.size[0]!r}"/>'
        return f'<cylinder radius="{self.size[0]!r}" length="{2 * self.size[1]!r}"/>'

    @property
    def keys(self) -> dict[str, Any]:
        """The keys of an object of the world."""
        shapes: dict[str, Any] = {
            "box": tuple(2 * side for side in self.size),
            "sphere": {"radius": self.size[0]},
            "cylinder": {"radius": self.size[0], "height": 2 * self.size[-1]},
        }
        pose = dict(zip(("x", "y", "z", "roll", "pitch", "yaw"), (*self.position, *self.rpy), strict=True))
        mass = {} if self.mass is None else {"mass": self.mass}
        return {"name": self.name, self.kind: shapes[self.kind], "pose": pose, "friction": self.friction} | mass


@dataclass(frozen=True)
class DrawnScene:
    """A robot of one link among bodies; `rate` in Hz, `duration` in s."""

    robot: Solid
    bodies: tuple[Solid, ...]
    ground: float
    rate: float
    duration: float

    def scene(self, folder: Path) -> Scene:
        """Return it as engines take it."""
        robot, path = self.robot, folder / "robot.urdf"
        moments = " ".join(
            f'{name}="{value!r}"' for name, value in zip(("ixx", "iyy", "izz"), robot.moments, strict=True)
        )
        path.write_text(
            f'<robot name="it"><link name="{_LINK}"><contact><lateral_friction value="{robot.friction!r}"/></contact>'
            f'<inertial><mass value="{robot.mass!r}"/><inertia {moments} ixy="0" ixz="0" iyz="0"/></inertial>'
            f"<collision><geometry>{robot.urdf_shape}</geometry></collision></link></robot>",
            encoding="utf-8",
        )
        keys = {"objects": tuple(body.keys for body in self.bodies), "ground": {"friction": self.ground}}
        (x, y, z), (roll, pitch, yaw) = robot.position, robot.rpy
        spec = Robot(model="robot.urdf", pose=Placement(x=x, y=y, z=z, roll=roll, pitch=pitch, yaw=yaw))
        world = World.model_validate(keys)
        return Scene(spec, read_urdf(path), world, Physics(rate=self.rate), Workspace(folder, folder))


def drawn_scene(chance: random.Random) -> DrawnScene:
    """Return a scene in which nothing overlaps at the start."""
    solids: list[Solid] = []
    for number in range(chance.choice((1, 1, 2, 3, 4))):
        is_robot = number == 0
        kind = chance.choice(("box", "sphere", "cylinder"))
        size = tuple(chance.uniform(0.05, 0.3) for _ in range({"box": 3, "sphere": 1, "cylinder": 2}[kind]))
        mass = chance.uniform(0.2, 10) if is_robot or chance.random() < 0.6 else None
        friction = chance.choice((0.0, 0.3, 0.5, 1.0))
        rpy: Vector3 = (chance.uniform(-3, 3), chance.uniform(-1.5, 1.5), chance.uniform(-3, 3))
        rpy = chance.choice(((0.0, 0.0, 0.0), rpy))
        reach = math.hypot(*size)
        for attempt in itertools.count():
            # Some bodies leave no place between them.
            room = 0.5 + attempt // 1000
            x, y = chance.uniform(-room, room), chance.uniform(-room, room)
            place: Vector3 = (x, y, reach + chance.uniform(0.005, 0.8))
            if all(math.dist(place, other.position) > reach + other.reach + 0.01 for other in solids):
                break
        solids.append(Solid("robot" if is_robot else f"b{number}", kind, size, mass, friction, place, rpy))
    rate = chance.choice((240.0, 500.0, 1000.0))
    return DrawnScene(solids[0], tuple(solids[1:]), chance.choice((0.3, 1.0)), rate, chance.choice((0.6, 1.2)))


def run(engine: str, drawn: DrawnScene) -> Trace:
    """Return the trace of all steps."""
    with tempfile.TemporaryDirectory() as name:
        scene = drawn.scene(Path(name))
        channels = Channels(
            contacts=True, objects=frozenset(body.name for body in drawn.bodies), link_contacts=frozenset({_LINK})
        )
        backend = ENGINES[engine].load()(scene, channels)
        try:
            backend.advance(0, [None] * round(drawn.duration * drawn.rate))
            return backend.collect()
        finally:
            backend.close()


def digest(trace: Trace) -> str:
    """Return the SHA-256 of the state, the poses of the bodies and the contacts."""
    hashed = hashlib.sha256(trace.state.tobytes())
    for name in sorted(trace.objects):
        hashed.update(trace.objects[name].position_xyz.tobytes() + trace.objects[name].orientation_xyzw.tobytes())
    hashed.update(repr(trace.contacts).encode())
    return hashed.hexdigest()


def failures(engine: str, drawn: DrawnScene) -> Iterator[str]:
    """Yield what does not hold."""
    trace = run(engine, drawn)
    motions = {drawn.robot.name: _Motion(trace.time, trace.base_position_xyz, trace.base_orientation_xyzw)}
    for body in drawn.bodies:
        record = trace.objects[body.name]
        motions[body.name] = _Motion(trace.time, record.position_xyz, record.orientation_xyzw)
    yield from _energy(drawn, motions)
    yield from _fall(drawn, trace)
    yield from _contacts(drawn, trace, motions, _SURFACE_M[engine])
    yield from _impulses(drawn, trace)
    if digest(run(engine, drawn)) != digest(trace):
        yield "repetition: the second run has another digest"


def _lengths(vectors: FloatArray) -> FloatArray:
    squares: FloatArray = np.square(vectors).sum(axis=1)
    return np.sqrt(squares)


class _Motion:
    """The poses of a body at all steps."""

    def __init__(self, time: FloatArray, position: FloatArray, orientation: FloatArray) -> None:
        self.time, self.position = time, position
        self.rotation = rotation_matrices(orientation)

    def energy(self, body: Solid) -> FloatArray:
        """Return kinetic and potential energy in J after each step but the first, from the poses alone."""
        step = np.diff(self.time)[:, None]
        velocity = np.diff(self.position, axis=0) / step
        turn = self.rotation[:-1].swapaxes(1, 2) @ self.rotation[1:]
        # The rotation vector of a small turn, in the frame of the body.
        sines = np.stack(
            [turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]], 1
        )
        length = _lengths(sines)[:, None] / 2
        angle = np.arctan2(length, (np.trace(turn, axis1=1, axis2=2)[:, None] - 1) / 2)
        rate = sines / 2 * np.where(length > 1e-9, angle / np.maximum(length, 1e-9), 1.0) / step
        mass = body.mass or 0.0
        kinetic: FloatArray = (mass * np.square(velocity).sum(axis=1) + np.dot(np.square(rate), body.moments)) / 2
        return kinetic + mass * _GRAVITY * self.position[1:, 2]


def _energy(drawn: DrawnScene, motions: Mapping[str, _Motion]) -> Iterator[str]:
    loose = [body for body in (drawn.robot, *drawn.bodies) if body.mass is not None]
    total = np.sum([motions[body.name].energy(body) for body in loose], axis=0)
    weight = sum(body.mass or 0.0 for body in loose) * _GRAVITY
    fall = weight * max(motions[body.name].position[0, 2] for body in loose)
    worst = int(np.argmax(total))
    if total[worst] - total[0] > 0.01 * fall + 1e-6:
        time = motions[drawn.robot.name].time[worst + 1]
        yield f"energy: {total[worst] - total[0]:.3g} J of {fall:.3g} J more at {time:.3f} s"


def _fall(drawn: DrawnScene, trace: Trace) -> Iterator[str]:
    touches = trace.link_contacts[_LINK].time
    free = trace.time < (touches[0] - 1.5 / drawn.rate if len(touches) else math.inf)
    steps = np.round(trace.time * drawn.rate)
    height = drawn.robot.position[2] - _GRAVITY * steps * (steps + 1) / 2 / drawn.rate**2
    off = np.abs(trace.base_position_xyz[:, 2] - height)[free]
    if off.size and off.max() > _FALL_M:
        yield f"energy: {off.max():.3g} m away from a free fall at {trace.time[int(off.argmax())]:.3f} s"


def _contacts(drawn: DrawnScene, trace: Trace, motions: Mapping[str, _Motion], surface: float) -> Iterator[str]:
    solids = {body.name: body for body in drawn.bodies}
    times = trace.time
    touching: dict[str, set[int]] = {}
    for contact in trace.contacts:
        step = int(np.argmin(np.abs(times - contact.time)))
        touching.setdefault(contact.body, set()).add(step)
        if contact.force < 0:
            yield f"contacts: a force of {contact.force} N at {contact.time:.3f} s"
        pair = ((drawn.robot.name, drawn.robot), (contact.body, solids[contact.body]))
        limit = surface + contact.depth + sum(_way(motions[name], step, contact.position_xyz) for name, _ in pair)
        for name, solid in pair:
            place = _local(motions[name], step, contact.position_xyz)
            # An engine names the place before or after the step.
            before = _local(motions[name], max(step - 1, 0), contact.position_xyz)
            off = min(abs(float(solid.outside(point[None])[0])) for point in (place, before))
            if off > limit:
                yield f"contacts: {off:.4f} m from the surface of {name} at {contact.time:.3f} s"
    for body in drawn.bodies:
        deep = _depth(drawn.robot, motions[drawn.robot.name], body, motions[body.name])
        for step in _missing(deep, touching.get(body.name, set())):
            yield f"contacts: {body.name} overlaps by {deep[step]:.4f} m at {times[step]:.3f} s, not listed"
    record = trace.link_contacts[_LINK]
    grounded = {int(np.argmin(np.abs(times - at))) for at, body in zip(record.time, record.body, strict=True)
                if record.bodies[body] == "ground"}  # fmt: skip
    robot = motions[drawn.robot.name]
    lowest = robot.position[:, 2] - drawn.robot.below(robot.rotation)
    for step in _missing(-lowest, grounded):
        yield f"contacts: {-lowest[step]:.4f} m in the ground at {times[step]:.3f} s, not listed"


def _missing(depth: FloatArray, listed: set[int]) -> list[int]:
    """Return the first step with an overlap that is not in contact, if any.

    Engines look for contacts before they move bodies: an overlap that a step makes is in contact at the next one.
    """
    steps = (int(step) for step in np.flatnonzero(depth[:-1] > _OVERLAP_M))
    return [step for step in steps if not listed & {step, step + 1}][:1]


def _local(motion: _Motion, step: int, point: Vector3) -> FloatArray:
    local: FloatArray = motion.rotation[step].T @ (np.array(point) - motion.position[step])
    return local


def _way(motion: _Motion, step: int, point: Vector3) -> float:
    """Return how far in m a body moves at a place, in this step or in the one before it."""
    ways = []
    for later in (step, max(step - 1, 0)):
        earlier = max(later - 1, 0)
        before = motion.rotation[earlier] @ _local(motion, later, point) + motion.position[earlier]
        ways.append(float(np.linalg.norm(before - point)))
    return max(ways)


def _depth(robot: Solid, own: _Motion, body: Solid, other: _Motion) -> FloatArray:
    """Return a lower bound in m on the overlap at all steps: that of the inner ball of one with the other."""
    bound = np.full(len(own.position), -np.inf)
    for solid, motion, shape, at in ((robot, own, body, other), (body, other, robot, own)):
        centres = np.einsum("tji,tj->ti", at.rotation, motion.position - at.position)
        bound = np.maximum(bound, min(solid.size) - shape.outside(centres))
    return bound


def _impulses(drawn: DrawnScene, trace: Trace) -> Iterator[str]:
    record, mass = trace.link_contacts[_LINK], drawn.robot.mass or 0.0
    step = 1 / drawn.rate
    frictions = {"ground": drawn.ground} | {body.name: body.friction for body in drawn.bodies}
    pushed, slack = np.zeros((len(trace), 3)), np.zeros(len(trace))
    for row, at in enumerate(record.time):
        index = int(np.argmin(np.abs(trace.time - at)))
        pushed[index] += record.force[row] * record.normal_xyz[row]
        slack[index] += record.force[row] * drawn.robot.friction * frictions[record.bodies[record.body[row]]]
    velocity = np.diff(trace.base_position_xyz, axis=0) / step
    force = mass * (np.diff(velocity, axis=0) / step + np.array([0, 0, _GRAVITY]))
    excess = _lengths(force - pushed[2:]) - slack[2:]
    limit = 0.05 * mass * _GRAVITY + 0.02 * _lengths(pushed[2:])
    worst = int(np.argmax(excess - limit))
    if excess[worst] > limit[worst]:
        yield f"impulses: {excess[worst]:.3g} N without a contact at {trace.time[worst + 2]:.3f} s"


def main() -> None:
    """Run the scenes, print those that do not hold and the counts, and exit with 1 if there is one."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=1000, help="scenes for each engine")
    parser.add_argument("--start", type=int, default=0, help="number of the first scene")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--engine", action="append", choices=list(ENGINES), help="repeatable; default: all installed")
    asked = parser.parse_args()
    counts = Counter[str]()
    for number in range(asked.start, asked.start + asked.count):
        drawn = drawn_scene(random.Random(f"{asked.seed}-{number}"))
        for engine in asked.engine or installed():
            wrong = list(failures(engine, drawn))
            counts[f"{engine}: {'fails' if wrong else 'holds'}"] += 1
            for text in wrong:
                counts[f"{engine}: {text.split(':')[0]}"] += 1
                print(f"{asked.seed}-{number} {engine}: {text}", flush=True)  # noqa: T201 - a command
    for text, count in sorted(counts.items()):
        print(f"{count:7} {text}")  # noqa: T201 - a command
    sys.exit(any(text.endswith("fails") for text in counts))


if __name__ == "__main__":
    main()
