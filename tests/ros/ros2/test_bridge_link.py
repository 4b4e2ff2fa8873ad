"""Messages on their way to the bridge and back, without ROS."""

from __future__ import annotations

import socket
from array import array

from sim_action.ros.ros2.bridge_frames import Frames


def test_arrays_travel_in_the_blob() -> None:
    message = {
        "header": {"frame_id": "laser"},
        "ranges": array("f", [0.5, float("inf")]),
        "data": array("B", b"\x00\xff"),
        "transforms": [{"child_frame_id": "a"}, {"child_frame_id": "b"}],
        "covariance": array("d", range(36)),
    }
    own, theirs = socket.socketpair()
    with own, theirs:
        assert Frames(own).send(message) == 2 * 4 + 2 + 36 * 8
        assert Frames(theirs).receive() == message
