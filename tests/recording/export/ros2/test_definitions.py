"""Definitions of messages, against those that rosbags has of ROS 2."""

from __future__ import annotations

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from sim_action.recording.export.ros2.definitions import _FIELDS, definition, full_name


@pytest.mark.parametrize("name", _FIELDS)
def test_each_type_and_all_that_it_is_made_of_is_that_of_ros(name: str) -> None:
    told = get_types_from_msg(definition(name), full_name(name))
    theirs = get_typestore(Stores.ROS2_HUMBLE).fielddefs
    assert full_name(name) in told
    for found, (_, fields) in told.items():
        assert fields == theirs[found][1], found
