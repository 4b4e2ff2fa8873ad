"""CSV: `--record csv`."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator
from typing import BinaryIO, ClassVar, Final

import numpy as np

from sim_action.core.geometry import rpy_from_quaternion
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.robot.robot_model import Reading
from sim_action.state.trace import FloatArray

# Names of columns, each with its unit.
_POSE: Final = (("x", "m"), ("y", "m"), ("z", "m"), ("qx", ""), ("qy", ""), ("qz", ""), ("qw", ""))
_TURNED: Final = (("roll", "rad"), ("pitch", "rad"), ("yaw", "rad"))
_TWIST: Final = (
    *(("vx", "m/s"), ("vy", "m/s"), ("vz", "m/s")),
    *(("wx", "rad/s"), ("wy", "rad/s"), ("wz", "rad/s")),
)
_KINDS: Final[tuple[Reading, ...]] = ("position", "velocity", "effort")


class CsvTable:
    """A table to open anywhere: time, pose and velocity of the base, joints, bodies that move; units in its header.

    All of the base and the bodies is seen from the world. Roll, pitch and yaw turn about the fixed axes, in this order.
    Cells of a body are empty until it appears.
    """

    extra: ClassVar[str] = ""
    packages: ClassVar[tuple[str, ...]] = ()

    @staticmethod
    def write(run: RecordedRun, file: BinaryIO) -> None:
        """See Export.write."""
        names, columns = zip(*_columns(run), strict=True)
        header = io.StringIO()
        csv.writer(header, lineterminator="\n").writerow(name for group in names for name in group)
        file.write(header.getvalue().encode())
        table = np.column_stack(columns)
        # Added to zero, what is -0 is 0.
        row = ",".join(["%.9g"] * table.shape[1]) + "\n"
        lines = (row % tuple(values) for values in (table + 0.0).tolist())
        # Of what is not there yet, a cell is empty.
        file.writelines(line.replace("nan", "").encode() for line in lines)


def _columns(run: RecordedRun) -> Iterator[tuple[list[str], FloatArray]]:
    """Names of columns, and the columns (T, n)."""
    trace = run.trace
    yield ["time [s]"], trace.time[:, None]
    yield _headed(_POSE), np.column_stack((trace.base_position_xyz, trace.base_orientation_xyzw))
    yield _headed(_TURNED), _turned(trace.base_orientation_xyzw)
    yield _headed(_TWIST), np.column_stack((trace.base_linear_xyz, trace.base_angular_xyz))
    for index, name in enumerate(trace.joint_names):
        joint = run.scene.model.joints_by_name[name]
        columns = [(kind, joint.dimension(kind).si) for kind in _KINDS]
        values = (trace.joint_position, trace.joint_velocity, trace.joint_effort)
        yield _headed(columns, name), np.column_stack([column[:, index] for column in values])
    for name, poses in run.bodies.items():
        yield _headed(_POSE, name), poses


def _headed(columns: Iterable[tuple[str, str]], owner: str = "") -> list[str]:
    """A spreadsheet takes what begins with = for a formula: no name of a stranger's comes first."""
    of = f" of {owner}" if owner else ""
    return [f"{name}{of} [{unit}]" if unit else f"{name}{of}" for name, unit in columns]


def _turned(orientations: FloatArray) -> FloatArray:
    """(T, 3) roll, pitch and yaw."""
    return np.array([rpy_from_quaternion((x, y, z, w)) for x, y, z, w in orientations.tolist()]).reshape(-1, 3)


class TumTrajectory:
    """The way of the base as text, a line a moment: `timestamp tx ty tz qx qy qz qw`; for evo and its like."""

    extra: ClassVar[str] = ""
    packages: ClassVar[tuple[str, ...]] = ()

    @staticmethod
    def write(run: RecordedRun, file: BinaryIO) -> None:
        """See Export.write."""
        trace = run.trace
        rows = np.column_stack((trace.time, trace.base_position_xyz, trace.base_orientation_xyzw))
        # Added to zero, what is rounded to -0 is 0.
        rows = rows.round(9) + 0.0
        file.write(b"# timestamp tx ty tz qx qy qz qw\n")
        file.writelines(b"%.6f %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n" % tuple(row) for row in rows.tolist())
