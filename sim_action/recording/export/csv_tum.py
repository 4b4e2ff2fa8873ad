"""Text formats: CSV (`--record csv`) and the trajectory format of the TUM RGB-D benchmark (`--record tum`)."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator
from typing import BinaryIO, ClassVar, Final

import numpy as np

from sim_action.core.geometry import rpy_from_quaternion
from sim_action.core.lazy_numpy import FloatArray
from sim_action.recording.export.recorded_run import RecordedRun
from sim_action.robot.model.kinematics import link_motion
from sim_action.robot.model.robot_model import Reading

# Names of columns, each with its unit.
_POSE: Final = (("x", "m"), ("y", "m"), ("z", "m"), ("qx", ""), ("qy", ""), ("qz", ""), ("qw", ""))
_TURNED: Final = (("roll", "rad"), ("pitch", "rad"), ("yaw", "rad"))
_TWIST: Final = (*(("vx", "m/s"), ("vy", "m/s"), ("vz", "m/s")), *(("wx", "rad/s"), ("wy", "rad/s"), ("wz", "rad/s")))
_KINDS: Final[tuple[Reading, ...]] = ("position", "velocity", "effort")


class CsvTable:
    """A table with units in its header: time, pose and velocity of the base, joints, links, moving bodies.

    The links come from `trace.links`. Poses and velocities are given in the world frame. Roll, pitch and yaw turn
    about the fixed axes, in this order. Cells of a body are empty until it appears.
    """

    extra: ClassVar[str] = ""
    packages: ClassVar[tuple[str, ...]] = ()

    @staticmethod
    def write(run: RecordedRun, file: BinaryIO) -> None:
        """Write a run; see `Export.write`."""
        names, columns = zip(*_columns(run), strict=True)
        header = io.StringIO()
        csv.writer(header, lineterminator="\n").writerow(name for group in names for name in group)
        file.write(header.getvalue().encode())
        table = np.column_stack(columns)
        # Adding zero turns -0 into 0.
        row = ",".join(["%.9g"] * table.shape[1]) + "\n"
        lines = (row % tuple(values) for values in (table + 0.0).tolist())
        # The cells of a body that has not appeared are empty.
        file.writelines(line.replace("nan", "").encode() for line in lines)


def _columns(run: RecordedRun) -> Iterator[tuple[list[str], FloatArray]]:
    """Yield the titles of columns, and the columns (T, n)."""
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
    for name in run.links:
        motion = link_motion(run.scene.model, trace, name)
        yield _headed(_POSE, name), np.column_stack((motion.position_xyz, motion.orientation_xyzw))
        yield _headed(_TURNED, name), _turned(motion.orientation_xyzw)
        yield _headed(_TWIST, name), np.column_stack((motion.linear_xyz, motion.angular_xyz))
    for name, poses in run.bodies.items():
        yield _headed(_POSE, name), poses


def _headed(columns: Iterable[tuple[str, str]], owner: str = "") -> list[str]:
    # A spreadsheet may read a name of a model in the first place as a formula.
    of = f" of {owner}" if owner else ""
    return [f"{name}{of} [{unit}]" if unit else f"{name}{of}" for name, unit in columns]


def _turned(orientations: FloatArray) -> FloatArray:
    return np.array([rpy_from_quaternion((x, y, z, w)) for x, y, z, w in orientations.tolist()]).reshape(-1, 3)


class TumTrajectory:
    """The trajectory of the base as text for evo and similar tools: lines of `timestamp tx ty tz qx qy qz qw`.

    If `trace.links` names links, it is the trajectory of the first of them.
    """

    extra: ClassVar[str] = ""
    packages: ClassVar[tuple[str, ...]] = ()

    @staticmethod
    def write(run: RecordedRun, file: BinaryIO) -> None:
        """Write a run; see `Export.write`."""
        trace, link = run.trace, run.links[0] if run.links else run.scene.model.root
        motion = link_motion(run.scene.model, trace, link)
        rows = np.column_stack((trace.time, motion.position_xyz, motion.orientation_xyzw))
        # Adding zero turns a rounded -0 into 0.
        rows = rows.round(9) + 0.0
        file.write(b"# timestamp tx ty tz qx qy qz qw\n")
        file.writelines(b"%.6f %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n" % tuple(row) for row in rows.tolist())
