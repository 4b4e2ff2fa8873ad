"""Find bodies on paths that press the robot against something.

Nothing stops a body on a path, so it pins the robot with whatever force the engine computes. That force is proportional
to the mass of the robot and to the depth of the overlap, and no machine has it. A robot that is squeezed even deeper is
thrown out at a speed that seems possible.

The robot is pinned while the mean force of a body on a path, over a short window, is many times the robot's weight, and
the robot does not accelerate accordingly: then something else holds it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from sim_action.core import units
from sim_action.core.errors import SimulationUnstable
from sim_action.core.records import dataclass
from sim_action.state.observation import Contact
from sim_action.state.trace import FloatArray, Trace
from sim_action.world.scene import Scene

MIN_WEIGHTS: Final = 20.0
"""The robot is pinned by a mean force of more than this many times its weight."""

MAX_SQUEEZE_M: Final = 0.025
"""A run in which a pinned robot overlaps the bodies around it by more, all depths added, is no longer physical."""

_WINDOW_S: Final = 0.05
# The weight is that on earth, because a pinning force does not depend on gravity.
_GRAVITY: Final = 9.81


@dataclass(slots=True)
class _Pin:
    """A body on a path that pins the robot.

    Attributes:
        time: the first moment in s.
        against: the other body or part, as in messages.
        force: the greatest mean force in N.
    """

    time: float
    link: str
    against: str
    force: float


class Pinning:
    """Watches a run for a robot that is pinned. It gets every block of steps in order."""

    def __init__(self, scene: Scene, velocity_xyz: Sequence[float]) -> None:
        """Begin at t = 0 with this velocity of the base in m/s, world frame."""
        self._rate, self._mass, self._bolted = scene.physics.rate, scene.model.mass, bool(scene.bolted_links)
        self._indices = {body.name: index for index, body in enumerate(scene.world.objects) if body.path}
        self._window = max(1, round(_WINDOW_S * self._rate))
        self._speeds = np.tile(np.array(velocity_xyz, dtype=np.float64), (self._window, 1))
        self._forces = {name: np.zeros(self._window - 1) for name in self._indices}
        self._recent: list[Contact] = []
        self._pins: dict[str, _Pin] = {}

    def watch(self, trace: Trace) -> tuple[Trace, SimulationUnstable | None]:
        """Return the moments before a pinned robot is squeezed too deep, and the error of the next one."""
        count = len(trace)
        if not count or not self._mass:
            return trace, None
        touches = [*self._recent, *(touch for touch in trace.contacts if touch.has_force)]
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

    @property
    def notes(self) -> Iterator[str]:
        """The notes on all bodies that pinned the robot."""
        for name, pin in self._pins.items():
            force, window = f"{float(f'{pin.force:.2g}'):,.0f} N", f"{1e3 * _WINDOW_S:g} ms"
            yield (
                f"'{name}' follows its path with unlimited force and pinned '{pin.link}' against {pin.against}, from "
                f"{pin.time:.2f} s on, with up to {force} on average over {window}; this is the force of the engine, "
                "not of a machine"
            )

    def _pressed(self, touches: Sequence[Contact], trace: Trace) -> dict[str, FloatArray]:
        """Return body on a path -> (T,) its mean force in N over the window that ends at each step; without zeros."""
        first, count = self._step(float(trace.time[0])), len(trace)
        found = {}
        forces = {name: np.concatenate((before, np.zeros(count))) for name, before in self._forces.items()}
        for touch in touches:
            if touch.body in forces:
                step = self._step(touch.time) - first
                if 0 <= step < count:
                    forces[touch.body][self._window - 1 + step] += touch.force
        for name, force in forces.items():
            if force.any():
                sums = np.concatenate(([0.0], np.cumsum(force)))
                found[name] = (sums[self._window :] - sums[: -self._window]) / self._window
            self._forces[name] = force[count:]
        return found

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
        return (trace.first(row) if row else trace.rows(slice(0))), error

    def _step(self, time: float) -> int:
        return round(time * self._rate)


def _strongest(forces: Iterator[tuple[str, float]]) -> str:
    """Return the name with the greatest sum of forces; empty without any."""
    sums: dict[str, float] = defaultdict(float)
    for name, force in forces:
        sums[name] += force
    return max(sums, key=lambda name: sums[name], default="")
