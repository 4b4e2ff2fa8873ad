"""Expand xacro text in a ROS workspace, for the tests of xacro."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree as ET

import pytest

from sim_action.robot.reading.xacro_documents import XacroError
from sim_action.robot.reading.xacro_expansion import Argument, Expansion, expand
from tests.ros_workspace import RosWorkspace

URDF = "src/rover_description/urdf"


def expanded(
    ros: RosWorkspace,
    body: str,
    arguments: Mapping[str, Argument] | None = None,
    environment: Mapping[str, str] | None = None,
) -> Expansion:
    return expand(ros.robot(body), arguments or {}, ros.packages(environment=environment))


def element(expansion: Expansion, path: str = "a") -> ET.Element:
    found = ET.fromstring(expansion.text).find(path)
    assert found is not None
    return found


def refusal(ros: RosWorkspace, body: str, arguments: Mapping[str, Argument] | None = None) -> XacroError:
    with pytest.raises(XacroError) as raised:
        expanded(ros, body, arguments)
    return raised.value


def told(ros: RosWorkspace, error: XacroError) -> str:
    """The error without the folder that the test is in."""
    return str(error).replace(f"{ros.root}/{URDF}/", "").replace(str(ros.root), "ROOT")
