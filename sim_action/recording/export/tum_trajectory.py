"""The trajectory format of TUM's RGB-D benchmark, which evo reads: `--record tum`."""

from __future__ import annotations

from typing import BinaryIO, ClassVar

import numpy as np

from sim_action.recording.export.recorded_run import RecordedRun


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
