"""How near the robot comes to bodies: every step is watched, but the engine is asked only when it can matter.

Distances change no faster than bodies move: what was 1 m farther away than anything that matters need not be looked at
before robot and body have moved by 1 m together. An engine that can recall where things were is told of many steps at
once: most of them are then never looked at one by one.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np

from sim_action.core.units import first_step
from sim_action.engines.foresight import Eye, Near
from sim_action.engines.odometer import Odometer, PoseOdometer
from sim_action.state.trace import FloatArray
from sim_action.state.trace_channels import Channels, ClearanceWatch
from sim_action.state.trace_records import ClearanceRecord
from sim_action.world import Body
from sim_action.world.scene import Scene

Recall = Callable[[int], object]
"""Has the engine answer for one of several steps that are over, by its number among them."""


class Clearances:
    """The live half of `Channels.clearances`."""

    def __init__(
        self,
        channels: Channels,
        scene: Scene,
        radii: Mapping[str, float],
        near: Near,
        body_at: Callable[[str], Sequence[float]],
    ) -> None:
        """`radii`: see Odometer.

        What follows asks the engine about the present; `body_at` for a body's position and unit quaternion, (7,).
        """
        self._rate, self._near, self._body_at = scene.physics.rate, near, body_at
        everything = tuple(body.name for body in scene.world.objects)
        watches = sorted(channels.clearances, key=repr)
        self._eyes = [Eye(watch, everything if watch.bodies is None else watch.bodies) for watch in watches]
        steps = (first_step(time, self._rate) for time in channels.openings | {0.0})
        self._openings = sorted(set(steps), reverse=True)
        self._robot, self._way = Odometer(scene.model, radii), 0.0
        # On which way anything matters again, in m.
        self._next = math.inf
        watched = {body for eye in self._eyes for body in eye.names}
        moving = (body for body in scene.world.objects if body.name in watched and _moves(body))
        self._moving = {body.name: PoseOdometer(_radius(body)) for body in moving}

    @property
    def is_idle(self) -> bool:
        """Whether nobody wants to know."""
        return not self._eyes

    @property
    def stand_still(self) -> bool:
        """Whether none of the bodies ever moves."""
        return not self._moving

    def see(self, step: int, pose: Sequence[float], joints: Sequence[float]) -> None:
        """Looks at a step, where the base has come to `pose` (7,) and the joints to `joints` (J,).

        Before t = 0, nobody looks.
        """
        if step <= 0:
            return
        self._open(step)
        moved = self._robot.advance(pose, joints)
        for name, odometer in self._moving.items():
            moved += odometer.advance(self._body_at(name))
        if moved < math.inf:
            self._way += moved
            if self._way > self._next:
                self._look(step, self._way, moved)
        elif all(map(math.isfinite, (*pose, *joints))):
            # Nobody knows how far; what has exploded is the watchdog's.
            self._forget()
            self._look(step, self._way, moved)

    def look_back(self, steps: Sequence[int], poses: FloatArray, joints: FloatArray, recall: Recall) -> None:
        """The same at T steps that are over, (T, 7) and (T, J), of bodies that stand still."""
        first = bisect_right(steps, 0)
        if first == len(steps):
            return
        there = np.column_stack((poses[first:], joints[first:]))
        exploded = np.flatnonzero(~np.isfinite(there).all(axis=1))
        end = int(exploded[0]) if len(exploded) else len(there)
        if end:
            self._look_through(steps[first : first + end], there[:end], lambda row: recall(first + row))

    def collect(self) -> dict[ClearanceWatch, ClearanceRecord]:
        """What was found since the last call."""
        records = {eye.watch: ClearanceRecord.of(eye.found) for eye in self._eyes}
        for eye in self._eyes:
            eye.found = []
        return records

    def _look_through(self, steps: Sequence[int], there: FloatArray, recall: Recall) -> None:
        moved = self._robot.advance_all(there[:, :7], there[:, 7:])
        bounded = np.isfinite(moved)
        ways = (self._way + np.cumsum(np.where(bounded, moved, 0.0))).tolist()
        self._way = ways[-1]
        for first, end in self._stretches(steps, np.flatnonzero(~bounded).tolist()):
            row = max(first, bisect_right(ways, self._next))
            while row < end:
                recall(row)
                self._look(steps[row], ways[row], float(moved[row]))
                row = max(row + 1, bisect_right(ways, self._next))

    def _stretches(self, steps: Sequence[int], far: Sequence[int]) -> Iterator[tuple[int, int]]:
        """From one row to the next at which everything begins anew: somebody begins to look, or all has moved far."""
        opened = (bisect_left(steps, opening) for opening in self._openings)
        starts = sorted({0, *far, *(row for row in opened if row < len(steps))})
        for first, end in pairwise((*starts, len(steps))):
            self._open(steps[first])
            if first in far:
                self._forget()
            yield first, end

    def _look(self, step: int, way: float, moved: float) -> None:
        for eye in self._eyes:
            if way > eye.due:
                eye.look(self._near, step / self._rate, way, moved)
        self._next = min([eye.due for eye in self._eyes])

    def _forget(self) -> None:
        for eye in self._eyes:
            eye.forget()
        self._next = -math.inf

    def _open(self, step: int) -> None:
        if not self._openings or step < self._openings[-1]:
            return
        while self._openings and step >= self._openings[-1]:
            self._openings.pop()
        for eye in self._eyes:
            eye.begin()
        self._next = -math.inf


def _moves(body: Body) -> bool:
    return body.mass is not None or bool(body.path) or body.appears is not None


def _radius(body: Body) -> float:
    """How far its shape is from its middle at most, in m."""
    if body.box is not None:
        return math.hypot(*body.box) / 2
    if body.cylinder is not None:
        return math.hypot(body.cylinder.radius, body.cylinder.height / 2)
    return body.sphere.radius if body.sphere is not None else math.inf
