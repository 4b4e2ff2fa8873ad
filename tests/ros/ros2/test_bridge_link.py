"""Messages on their way to the bridge and back, without ROS."""

from __future__ import annotations

import json
from array import array

from sim_action.ros.ros2.bridge_link import _packed, _unpacked


def test_arrays_travel_in_the_blob() -> None:
    message = {
        "header": {"frame_id": "laser"},
        "ranges": array("f", [0.5, float("inf")]),
        "data": b"\x00\xff",
        "transforms": [{"child_frame_id": "a"}, {"child_frame_id": "b"}],
        "covariance": array("d", range(36)),
    }
    blob = bytearray()
    text = json.dumps(_packed(message, blob))
    assert len(blob) == 2 * 4 + 2 + 36 * 8
    assert _unpacked(json.loads(text), memoryview(blob)) == {**message, "data": array("B", [0, 255])}
