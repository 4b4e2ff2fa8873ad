"""The launch file of the nodes that a scenario lists."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import yaml
from hypothesis import given
from hypothesis import strategies as st
from pydantic import JsonValue

from sim_action.ros.ros1.command_source.node_spec import NodeSpec, launch_text

TEXT = st.text(max_size=20)
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**31), 2**31) | st.floats(allow_nan=False, allow_infinity=False) | TEXT,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXT, inner, max_size=3),
    max_leaves=6,
)


def only_node(spec: NodeSpec) -> ET.Element:
    (element,) = ET.fromstring(launch_text([spec]))
    return element


def test_a_node_in_short_is_named_after_its_file() -> None:
    node = only_node(NodeSpec.model_validate("my_robot/go-there.py"))

    assert node.attrib == {"pkg": "my_robot", "type": "go-there.py", "name": "go_there"}
    assert list(node) == []


def test_all_that_can_be_said_of_a_node_is_told() -> None:
    spec = NodeSpec(
        package="p", type="t", name="n", args="-a b", remap={"cmd_vel": "/x"}, namespace="left", required=True
    )
    node = only_node(spec)

    assert node.attrib == {"pkg": "p", "type": "t", "name": "n", "args": "-a b", "ns": "left", "required": "true"}
    assert [child.attrib for child in node] == [{"from": "cmd_vel", "to": "/x"}]


@given(st.dictionaries(st.from_regex(r"[a-z]{1,8}", fullmatch=True), VALUES, min_size=1, max_size=4))
def test_parameters_are_read_as_they_were_meant(params: dict[str, JsonValue]) -> None:
    told = only_node(NodeSpec(package="p", type="t", params=params)).findtext("rosparam")

    assert told is not None
    # As roslaunch reads it.
    assert yaml.safe_load(told) == params
