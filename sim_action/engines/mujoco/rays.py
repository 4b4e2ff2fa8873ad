"""Rays in MuJoCo. They meet what is in a group that they look for; what is not of the world is in another one."""

from __future__ import annotations

from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim_action.core.geometry import Vector3
from sim_action.engines.mujoco.model import Compiled

_Floats = NDArray[np.float64]

# Groups of geoms: rays look for the first one alone.
_SEEN: Final = 0
_UNSEEN: Final = 1
_LOOK_FOR: Final = np.array([group == _SEEN for group in range(mujoco.mjNGROUP)], dtype=np.uint8)


class Rays:
    """What rays meet at present; costs nothing until it is asked."""

    def __init__(self, compiled: Compiled) -> None:
        self._model, self._data = compiled.model, compiled.data
        self._own_data: Any = None
        groups = self._model.geom_group
        groups[groups == _SEEN] = _UNSEEN
        groups[list(compiled.bodies)] = _SEEN

    def cast(self, start_xyz: Vector3, ends_xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        """See EngineQueries.cast_rays."""
        data, start = self._present(), np.array(start_xyz)
        ways = ends_xyz - start
        shares, around = _cast(self._model, data, start, ways)
        hidden: set[int] = set()
        while around:
            hidden |= around
            self._model.geom_group[list(hidden)] = _UNSEEN
            shares, around = _cast(self._model, data, start, ways)
        if hidden:
            self._model.geom_group[list(hidden)] = _SEEN
        return shares

    def _present(self) -> Any:
        """After a step, the engine has but where bodies were before it; where they are is worked out beside the run."""
        if self._own_data is None:
            self._own_data = mujoco.MjData(self._model)
        self._own_data.qpos[:] = self._data.qpos
        mujoco.mj_kinematics(self._model, self._own_data)
        return self._own_data


def _cast(model: Any, data: Any, start: _Floats, ways: _Floats) -> tuple[_Floats, set[int]]:
    """The share of its way that each ray has free; and what it begins inside of, where it meets the far side."""
    count = len(ways)
    shares, normals, geoms = np.empty(count), np.zeros(3 * count), np.empty(count, np.int32)
    fixed_too, no_body, anywhere = True, -1, mujoco.mjMAXVAL
    mujoco.mj_multiRay(
        model, data, start, ways.ravel(), _LOOK_FOR, fixed_too, no_body, geoms, shares, normals, count, anywhere
    )
    # Only what a ray meets has a normal, which points out of it.
    outward = np.einsum("ij,ij->i", normals.reshape(-1, 3), ways)
    around = set(geoms[outward > 0].tolist()) if outward.max() > 0 else set()
    # The engine looks further than rays reach, and says -1 where they meet nothing.
    shares[(shares < 0) | (shares > 1)] = np.inf
    return shares, around
