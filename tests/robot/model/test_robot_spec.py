"""The `robot` section of a scenario."""

from __future__ import annotations

import pytest

from sim_action.core.errors import InvalidPart
from sim_action.robot.model.robot_spec import Robot


def test_arguments_are_for_a_xacro_file_only() -> None:
    assert Robot(model="arm.urdf.xacro", args={"size": 2}).args == {"size": 2}
    with pytest.raises(InvalidPart, match=r"only a \.xacro file has arguments, and the model is 'arm\.urdf'"):
        Robot(model="arm.urdf", args={"size": 2})
