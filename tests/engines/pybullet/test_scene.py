"""Bodies as PyBullet gets them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core import geometry

pytestmark = pytest.mark.pybullet

angles = st.floats(-math.pi, math.pi)
AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@given(angles, angles, angles)
def test_the_quaternion_of_a_matrix_turns_as_the_matrix(roll: float, pitch: float, yaw: float) -> None:
    from sim_action.engines.pybullet.scene import _turned

    rotation = geometry.quaternion_from_rpy(roll, pitch, yaw)
    columns = [geometry.rotate(rotation, axis) for axis in AXES]
    found = _turned(np.array(columns).T)
    assert math.hypot(*found) == pytest.approx(1.0)
    assert [geometry.rotate(found, axis) for axis in AXES] == [pytest.approx(column, abs=1e-9) for column in columns]
