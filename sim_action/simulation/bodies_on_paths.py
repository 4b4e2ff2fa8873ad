"""The guards of bodies on paths, which nothing stops: they may pin the robot, or pass through other bodies.

A body on a path pins the robot with any force that the engine computes. That force is proportional
to the mass of the robot and to the depth of the overlap, and no machine has it. A robot that is squeezed even deeper is
thrown out at a speed that seems possible.

The robot is pinned while the mean force of a body on a path, over a short window, is many times the robot's weight, and
the robot does not accelerate accordingly: then something else holds it.

Assertions judge the robot only, so a body that passes through another one on its path would stay unseen. That search
needs no engine: the paths are known. It looks at the moments of the frames of a replay, and skips those at which the
body cannot have come near enough.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import Final, Self

import numpy as np
from typing_extensions import override

from sim_action.core import geometry, units
from sim_action.core.errors import RunError, SimulationUnstable
from sim_action.core.geometry import Pose
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.records import dataclass
from sim_action.core.units import first_step
from sim_action.scenario.stage import DEPTH
from sim_action.simulation.convex_pieces import Obstacle, Piece, hull_distance, part_pieces, part_soups, turned
from sim_action.simulation.guards import NO_BODIES, Guard
from sim_action.state.observation import Contact
from sim_action.state.trace import Trace
from sim_action.state.trace_records import FRAME_RATE
from sim_action.world import GROUND, Body, path_of, placed
from sim_action.world.body import PosePath
from sim_action.world.parts import reach
from sim_action.world.scene import Scene

MIN_WEIGHTS: Final = 20.0  # the robot is pinned by a mean force of more than this many times its weight

MAX_SQUEEZE_M: Final = 0.025
"""A run in which a pinned robot overlaps the bodies around it by more, all depths added, is no longer physical."""

_WINDOW_S: Final = 0.05
_GRAVITY: Final = 9.81  # the weight is that on earth, because a pinning force does not depend on gravity

# A search that takes more comparisons of two shapes, or frames, ends without a result.
_MAX_COMPARISONS: Final = 500
_MAX_FRAMES: Final = 3_000
_TOUCH_M: Final = 1e-7  # nearer hulls overlap


@dataclass(slots=True)
class _Pin:
    """A body on a path that pins the robot."""

    time: float  # the first moment in s
    link: str
    against: str  # the other body or part, as in messages
    force: float  # the greatest mean force in N


class Pinning(Guard):
    """Watches a run for a robot that is pinned."""

    def __init__(self, scene: Scene, velocity_xyz: Sequence[float]) -> None:
        """Begin at t = 0 with this velocity of the base in m/s, world frame."""
        self._rate, self._mass, self._bolted = scene.physics.rate, scene.model.mass, bool(scene.bolted_links)
        self._indices = {body.name: index for index, body in enumerate(scene.world.objects) if body.path}
        self._window = max(1, round(_WINDOW_S * self._rate))
        self._speeds = np.tile(np.array(velocity_xyz, dtype=np.float64), (self._window, 1))
        self._forces = {name: np.zeros(self._window - 1) for name in self._indices}
        self._recent: list[Contact] = []
        self._pins: dict[str, _Pin] = {}

    @override
    def watch(self, trace: Trace, bodies: FloatArray = NO_BODIES) -> tuple[Trace, RunError | None]:
        count = len(trace)
        if not count or not self._mass:
            return trace, None
        touches = [*self._recent, *(touch for touch in trace.contacts if touch.has_force and touch.body != GROUND)]
        self._recent = [touch for touch in touches if touch.time > float(trace.time[-1]) - 2 * _WINDOW_S]
        pressed = self._pressed(touches, trace)
        speeds = np.vstack((self._speeds, trace.base_linear_xyz))
        self._speeds = speeds[-self._window :]
        squeezed = np.zeros(count, dtype=np.bool_)
        if pressed:
            pushed = np.sqrt(np.square(speeds[self._window :] - speeds[: -self._window]).sum(axis=1))
            limit = MIN_WEIGHTS * self._mass * _GRAVITY + self._mass * pushed * self._rate / self._window
            for name, mean in pressed.items():
                rows = np.flatnonzero(mean > limit)
                if len(rows):
                    self._note(name, float(trace.time[rows[0]]), float(mean[rows].max()), touches)
                    squeezed[rows] = True
        if not squeezed.any():
            return trace, None
        deep = np.flatnonzero(squeezed & (self._depths(touches, trace) > MAX_SQUEEZE_M))
        return (trace, None) if not len(deep) else self._stopped(trace, int(deep[0]))

    @override
    def notes(self, end: float) -> Iterator[str]:
        for name, pin in self._pins.items():
            force, window = f"{float(f'{pin.force:.2g}'):,.0f} N", f"{1e3 * _WINDOW_S:g} ms"
            yield (
                f"'{name}' follows its path with unlimited force and pinned '{pin.link}' against {pin.against}, from "
                f"{pin.time:.2f} s on, with up to {force} on average over {window}; this is the force of the engine, "
                "not of a machine"
            )

    def _pressed(self, touches: Sequence[Contact], trace: Trace) -> dict[str, FloatArray]:
        """Return body on a path -> (T,) its mean force in N over the window that ends at each step; without zeros."""
        first = self._step(float(trace.time[0]))
        count = len(trace)
        mean_forces = {}
        forces = {name: np.concatenate((before, np.zeros(count))) for name, before in self._forces.items()}
        for touch in touches:
            if touch.body in forces:
                step = self._step(touch.time) - first
                if 0 <= step < count:
                    forces[touch.body][self._window - 1 + step] += touch.force
        for name, force in forces.items():
            if force.any():
                sums = np.concatenate(([0.0], np.cumsum(force)))
                mean_forces[name] = (sums[self._window :] - sums[: -self._window]) / self._window
            self._forces[name] = force[count:]
        return mean_forces

    def _depths(self, touches: Sequence[Contact], trace: Trace) -> FloatArray:
        """Return (T,) m: the depth of the overlap with each body, added up over the bodies."""
        first = self._step(float(trace.time[0]))
        deepest: dict[tuple[int, str], float] = defaultdict(float)
        for touch in touches:
            where = self._step(touch.time) - first, touch.body
            deepest[where] = max(deepest[where], touch.depth)
        depths = np.zeros(len(trace))
        for (step, _), depth in deepest.items():
            if 0 <= step < len(depths):
                depths[step] += depth
        return depths

    def _note(self, name: str, time: float, force: float, touches: Sequence[Contact]) -> None:
        if name in self._pins:
            self._pins[name].force = max(self._pins[name].force, force)
            return
        since = [touch for touch in touches if time - _WINDOW_S <= touch.time <= time]
        link = _strongest((touch.link, touch.force) for touch in since if touch.body == name)
        other = _strongest((touch.body, touch.force) for touch in since if touch.body != name)
        against = f"'{other}'" if other else "its own joints" if self._bolted else "the ground"
        self._pins[name] = _Pin(time, link, against, force)

    def _stopped(self, trace: Trace, row: int) -> tuple[Trace, SimulationUnstable]:
        name, pin = max(self._pins.items(), key=lambda item: item[1].force)
        deep = units.display(MAX_SQUEEZE_M, "m")
        error = SimulationUnstable(
            f"simulation unstable at t = {trace.time[row]:.3f} s: '{name}' follows its path with unlimited force and "
            f"squeezes '{pin.link}' against {pin.against} by more than {deep}, so that an engine throws it out; end "
            "the path where it touches the robot, or keep the robot out of its way",
            keys=("world", "objects", self._indices[name], "path"),
        )
        return trace.first(row), error

    def _step(self, time: float) -> int:
        return round(time * self._rate)


def _strongest(forces: Iterator[tuple[str, float]]) -> str:
    """Return the name with the greatest sum of forces; empty without any."""
    sums: dict[str, float] = defaultdict(float)
    for name, force in forces:
        sums[name] += force
    return max(sums, key=lambda name: sums[name], default="")


class Crossings(Guard):
    """Finds bodies on paths that pass through other bodies of the world."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene

    @override
    def follow(self, scene: Scene) -> None:
        self._scene = scene

    @override
    def notes(self, end: float) -> Iterator[str]:
        scene = self._scene
        travellers = [_Traveller.of(scene, body) for body in scene.world.objects if body.path]
        still = [body for body in scene.world.objects if body.mass is None and not body.path]
        fixed = _obstacle(scene, still, moves=False)
        for number, one in enumerate(travellers):
            meetings = {} if fixed is None else one.meets(fixed, None, end, scene.physics.rate)
            for other in travellers[:number]:
                own = _obstacle(scene, [other.body], moves=True)
                meetings |= {} if own is None else one.meets(own, other.path, end, scene.physics.rate)
            for name, time in sorted(meetings.items(), key=lambda item: item[1]):
                yield (
                    f"body '{one.body.name}' passes through body '{name}' on its path, at {time:.2f} s: nothing "
                    "stops it, and no assertion judges two bodies of the world"
                )


@dataclass(frozen=True, eq=False)
class _Traveller:
    """A body on a path, its convex pieces, and the greatest speed of any of its points in m/s."""

    body: Body
    path: PosePath
    pieces: tuple[Piece, ...]
    fastest: float

    @classmethod
    def of(cls, scene: Scene, body: Body) -> Self:
        """Return a body of a scene."""
        parts = scene.parts_of(body)
        path = path_of(body, parts)
        return cls(body, path, tuple(part_pieces(parts)), path.fastest(max(map(reach, parts)))[0])

    def meets(self, obstacle: Obstacle, path: PosePath | None, end: float, rate: float) -> dict[str, float]:
        """Return name -> s: when it first overlaps each body of an obstacle, which may be on a path itself."""
        search = _Search(obstacle)
        free_until = 0.0
        # The sim times in s to look at, up to the end of a run.
        paths = [pose_path for pose_path in (self.path, path) if pose_path is not None]
        # A path with a pace ends later or earlier than it states.
        loops = any(pose_path.loops or pose_path.pace for pose_path in paths)
        last = max(self.path.times[-1], path.times[-1] if path is not None else 0.0)
        until = end if loops else min(last, end)
        frames: list[float] = (np.arange(min(int(until * FRAME_RATE) + 1, _MAX_FRAMES)) / FRAME_RATE).tolist()
        corners = [time for pose_path in paths for time in pose_path.times if time <= until]
        # Bodies may appear after the end of the path.
        for time in sorted({*frames, *corners, end}):
            # Bodies may appear before the last moment.
            if time < min(free_until, end):
                continue
            pose = self.path.pose(time)
            if path is not None:
                pose = geometry.compose(geometry.inverse(path.pose(time)), pose)
            gap = min((search.look(piece, pose, time, first_step(time, rate)) for piece in self.pieces), default=0.0)
            if search.is_over:
                break
            if path is None and gap > 0:
                free_until = time + (gap / self.fastest if self.fastest else end)
        return search.overlap_times


class _Search:
    """The search for the bodies of an obstacle that something overlaps; `overlap_times`: name -> s."""

    def __init__(self, obstacle: Obstacle) -> None:
        self._obstacle, self._left = obstacle, _MAX_COMPARISONS
        self.overlap_times: dict[str, float] = {}

    @property
    def is_over(self) -> bool:
        """True if all bodies are found, or the search took too long."""
        return not self._left or len(self.overlap_times) == len(self._obstacle.names)

    def look(self, piece: Piece, pose: Pose, time: float, step: int) -> float:
        """Compare a piece in a frame at `pose` with the pieces near it; return a lower bound on its distance in m."""
        obstacle = self._obstacle
        points = turned(piece.points, pose.orientation_xyzw) + pose.position_xyz
        lower, upper = points.min(axis=0) - piece.radius, points.max(axis=0) + piece.radius
        for index in obstacle.near(lower + DEPTH, upper - DEPTH, step):
            name = obstacle.names[int(obstacle.bodies[index])]
            if name not in self.overlap_times and self._left:
                self._left -= 1
                # The piece at `points` must be deeper inside the other one than an ordinary contact.
                middle = (points.min(axis=0) + points.max(axis=0)) / 2
                thick = piece.width - 2 * piece.radius
                smaller = middle + (points - middle) * max(0.0, 1 - 2 * DEPTH / thick if thick > 0 else 0.0)
                limit = max(0.0, piece.radius - DEPTH) + float(obstacle.radius[index])
                if hull_distance(smaller, obstacle.corners(index), limit) <= max(limit, _TOUCH_M):
                    self.overlap_times[name] = time
        return float(np.maximum(obstacle.lower - upper, lower - obstacle.upper).max(axis=1).min())


def _obstacle(scene: Scene, bodies: Sequence[Body], *, moves: bool) -> Obstacle | None:
    """Return bodies in the world frame, or in their own if they move; None without shapes."""
    shapes = []
    for body in bodies:
        parts = scene.parts_of(body)
        pieces, soups = tuple(part_pieces(parts)), tuple(part_soups(parts, is_solid=True))
        if pieces or soups:
            pose = Pose() if moves else placed(body, parts)
            shapes.append((body.name, body.presence(scene.physics.rate), pose, pieces, soups))
    return Obstacle.of(shapes) if shapes else None
