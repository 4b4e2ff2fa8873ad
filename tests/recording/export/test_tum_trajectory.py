"""The format of TUM, as evo reads it: eight numbers a line between blanks, and lines that begin with # are not read."""

from __future__ import annotations

import io
import re

import numpy as np

from sim_action.recording.export.tum_trajectory import TumTrajectory
from tests.recording.export.runs import TIME, run


def test_it_is_the_way_of_the_base() -> None:
    made, file = run(), io.BytesIO()
    TumTrajectory.write(made, file)
    comment, *lines = file.getvalue().decode("ascii").splitlines()
    assert comment == "# timestamp tx ty tz qx qy qz qw"
    assert all(re.fullmatch(r"-?\d+\.\d+( -?\d+\.\d+){7}", line) for line in lines)
    table = np.loadtxt(lines)
    assert table.shape == (len(TIME), 8)
    np.testing.assert_allclose(table[:, 0], made.trace.time, atol=1e-6)
    np.testing.assert_allclose(table[:, 1:4], made.trace.base_position_xyz, atol=1e-9)
    np.testing.assert_allclose(table[:, 4:], made.trace.base_orientation_xyzw, atol=1e-9)
    assert "-0.000000000" not in file.getvalue().decode()
