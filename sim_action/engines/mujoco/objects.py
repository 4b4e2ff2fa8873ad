"""Where the bodies of the world are in MuJoCo."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist
from sim_action.engines.body_tracks import Look
from sim_action.engines.mujoco.model import Compiled
from sim_action.engines.mujoco.shapes import wxyz

FloatArray = NDArray[np.float64]

_IN_OUR_ORDER: Final = np.array([0, 1, 2, 4, 5, 6, 3])


class Objects:
    """The bodies of the world at present, as the joint positions have it: those of a step are up to date after it."""

    def __init__(self, compiled: Compiled) -> None:
        self._model, self._data = compiled.model, compiled.data
        self._numbers = {name: int(self._model.geom_bodyid[geom]) for geom, name in compiled.bodies.items()}

    def number(self, name: str) -> int:
        """The engine's, of a body."""
        return self._numbers[name]

    def at(self, name: str) -> list[float]:
        """Its position and its unit quaternion, (7,), as the engine orders it."""
        body = self._numbers[name]
        if self._model.body_dofnum[body]:
            start = self._model.jnt_qposadr[self._model.body_jntadr[body]]
            there: list[float] = self._data.qpos[start : start + 7].tolist()
            return there
        return [*self._model.body_pos[body].tolist(), *self._model.body_quat[body].tolist()]

    def pose(self, name: str) -> Pose:
        """Of its middle, world frame."""
        px, py, pz, qw, qx, qy, qz = self.at(name)
        return Pose((px, py, pz), (qx, qy, qz, qw))

    def looking_at(self, names: Sequence[str]) -> Look:
        """See Look."""
        model, numbers = self._model, [self._numbers[name] for name in names]
        free = [place for place, body in enumerate(numbers) if model.body_dofnum[body]]
        fixed = [place for place, body in enumerate(numbers) if not model.body_dofnum[body]]
        starts = [model.jnt_qposadr[model.body_jntadr[numbers[place]]] for place in free]
        # The engine has quaternions as w, x, y, z.
        taken = np.add.outer(np.array(starts, dtype=np.intp), _IN_OUR_ORDER)
        held = np.array([numbers[place] for place in fixed], dtype=np.intp)

        def look() -> FloatArray:
            row = np.empty((len(names), 7))
            row[free] = self._data.qpos[taken]
            if fixed:
                row[fixed, :3], row[fixed, 3:] = model.body_pos[held], model.body_quat[held][:, _IN_OUR_ORDER[3:] - 3]
            return row.ravel()

        return look

    def put(self, name: str, pose: Pose, twist: Twist) -> bool:
        """Sets where a body is, world frame; whether it can have a velocity, which is set as well."""
        body = self._numbers[name]
        moves = bool(self._model.body_dofnum[body])
        if moves:
            start, first = self._model.jnt_qposadr[self._model.body_jntadr[body]], self._model.body_dofadr[body]
            self._data.qpos[start : start + 7] = *pose.position_xyz, *wxyz(pose.orientation_xyzw)
            # The engine has the angular velocity in the body's own frame, the linear one in the world's.
            turning = geometry.rotate(geometry.conjugate(pose.orientation_xyzw), twist.angular_xyz)
            self._data.qvel[first : first + 6] = *twist.linear_xyz, *turning
        else:
            self._model.body_pos[body], self._model.body_quat[body] = pose.position_xyz, wxyz(pose.orientation_xyzw)
        return moves
