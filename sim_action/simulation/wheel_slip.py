"""Notes on wheels whose model states so little friction that they slip, such as ROBOTIS's TurtleBot3 with 0.1."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np

from sim_action.core import geometry, units
from sim_action.drives.wheels import wheel
from sim_action.state.trace import FloatArray, Trace
from sim_action.world.scene import Scene

_LEAST_SLIDE: Final = 0.01
"""The share of the rolled distance from which sliding is reported as slip."""

_LEAST_WAY_M: Final = 1e-3


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
        for found, radius in self._wheels:
            speed = trace.joint_velocity[:, columns[found.joint]]
            arm = _turned(trace.base_orientation_xyzw, found.position_xyz)
            axle = _turned(trace.base_orientation_xyzw, found.axis_xyz)
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
