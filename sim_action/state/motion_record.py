"""The motion of a run at every physics step, as two runs of a scenario are compared: base, joints, links and bodies.

A run writes it for the comparison only: it does not depend on the stored trace, and no results keep it.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from sim_action.core.files import open_regular
from sim_action.core.lazy_numpy import FloatArray, NDArray, np
from sim_action.core.records import dataclass, field
from sim_action.state.trace import yaw_angles
from sim_action.state.trace_storage import TraceError, refuse_too_large, save_arrays

_POSE: Final = 7


@dataclass(frozen=True, eq=False)
class MotionRecord:
    """The motion at T moments: t = 0 and each physics step after it."""

    time: FloatArray
    # (T, 7) the pose of the base link in the world frame: position in m, and unit quaternion x, y, z, w
    base: FloatArray
    # joint name -> its positions (T,) in rad, or m if prismatic
    joints: Mapping[str, FloatArray] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)  # joint name -> "rad" or "m"
    # links, bodies: name -> poses (T, 7) in the world frame, for those that are compared
    links: Mapping[str, FloatArray] = field(default_factory=dict)
    bodies: Mapping[str, FloatArray] = field(default_factory=dict)
    bolted: bool = False  # True if the base is fixed

    def __len__(self) -> int:
        return len(self.time)

    def rows(self, wanted: NDArray[np.intp]) -> MotionRecord:
        """Return some of the moments."""
        return MotionRecord(
            self.time[wanted],
            self.base[wanted],
            {name: column[wanted] for name, column in self.joints.items()},
            self.units,
            {name: poses[wanted] for name, poses in self.links.items()},
            {name: poses[wanted] for name, poses in self.bodies.items()},
            self.bolted,
        )

    @property
    def yaw(self) -> FloatArray:
        """The heading of the base about the world's z axis, (T,) rad in (-pi, pi]."""
        return yaw_angles(self.base[:, 3:])

    @property
    def is_finite(self) -> bool:
        """True if all numbers are finite."""
        columns = (self.time, self.base, *self.joints.values(), *self.links.values(), *self.bodies.values())
        return all(bool(np.isfinite(column).all()) for column in columns)

    def save(self, path: Path) -> None:
        """Write the record as .npz. Raise OSError."""
        arrays: dict[str, Any] = {
            "time": self.time,
            "base": self.base,
            "bolted": np.array(self.bolted),
            **_named("joints", self.joints),
            "units": np.array([self.units[name] for name in self.joints], dtype=np.str_),
            **_named("links", self.links),
            **_named("bodies", self.bodies),
        }
        save_arrays(arrays, path)

    @classmethod
    def load(cls, path: Path) -> MotionRecord:
        """Read a file that `save` wrote, without unpickling. Raise TraceError."""
        try:
            with open_regular(path, follow_link=False) as file, np.load(file, allow_pickle=False) as stored:
                refuse_too_large(stored)
                time = _column(stored["time"], stored["time"].size)
                joints = _columns(stored, "joints", (len(time),))
                links, bodies = (_columns(stored, group, (len(time), _POSE)) for group in ("links", "bodies"))
                base, bolted = _column(stored["base"], len(time), _POSE), bool(stored["bolted"])
                units = dict(zip(joints, stored["units"].tolist(), strict=True))
                return cls(time, base, joints, units, links, bodies, bolted)
        except Exception as error:  # noqa: BLE001 - numpy and zipfile raise many types for damaged files
            raise TraceError(f"{path}: not a record of a motion: {error}") from None


def _named(group: str, columns: Mapping[str, FloatArray]) -> dict[str, Any]:
    numbered = {f"{group}_{number}": column for number, column in enumerate(columns.values())}
    return {f"{group}_names": np.array(list(columns), dtype=np.str_), **numbered}


def _columns(stored: Mapping[str, Any], group: str, shape: tuple[int, ...]) -> dict[str, FloatArray]:
    names = stored[f"{group}_names"].tolist()
    return {str(name): _column(stored[f"{group}_{number}"], *shape) for number, name in enumerate(names)}


def _column(values: Any, *shape: int) -> FloatArray:
    """Return an array after its shape and type are checked. Raise ValueError."""
    if values.shape != shape or values.dtype != np.float64:
        raise ValueError(f"an array has the shape {values.shape} of {values.dtype}")
    column: FloatArray = values
    return column
