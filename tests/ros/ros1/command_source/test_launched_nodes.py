"""The launch file of the nodes that a scenario lists, and events of a launcher as they arrive."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree as ET

import yaml
from hypothesis import given
from hypothesis import strategies as st
from pydantic import JsonValue

from sim_action.ros.launch_events import EventFile
from sim_action.ros.ros1.command_source.launched_nodes import is_failure, launch_text, words_of
from sim_action.ros.ros1.command_source.spec import NodeSpec

TEXT = st.text(max_size=20)
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**31), 2**31) | st.floats(allow_nan=False, allow_infinity=False) | TEXT,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXT, inner, max_size=3),
    max_leaves=6,
)


def only_node(spec: NodeSpec) -> ET.Element:
    (element,) = ET.fromstring(launch_text([spec]))
    return element


def test_a_node_is_in_the_launch_file_with_all_that_is_said_of_it() -> None:
    short = only_node(NodeSpec.model_validate("my_robot/go-there.py"))
    assert (short.attrib, list(short)) == ({"pkg": "my_robot", "type": "go-there.py", "name": "go_there"}, [])
    node = only_node(
        NodeSpec(package="p", type="t", name="n", args="-a b", remap={"cmd_vel": "/x"}, namespace="left", required=True)
    )
    assert node.attrib == {"pkg": "p", "type": "t", "name": "n", "args": "-a b", "ns": "left", "required": "true"}
    assert [child.attrib for child in node] == [{"from": "cmd_vel", "to": "/x"}]


@given(st.dictionaries(st.from_regex(r"[a-z]{1,8}", fullmatch=True), VALUES, min_size=1, max_size=4))
def test_parameters_are_read_as_they_were_meant(params: dict[str, JsonValue]) -> None:
    told = only_node(NodeSpec(package="p", type="t", params=params)).findtext("rosparam")
    assert told is not None
    # As roslaunch reads it.
    assert yaml.safe_load(told) == params


def test_who_has_ended_well_is_told_from_who_has_not(tmp_path: Path) -> None:
    events = EventFile(tmp_path / "events")
    ends = ((0, False), (0, True), (1, False), (-11, False), (None, False))
    lines = (json.dumps({"event": "died", "exit_code": code, "required": required}) for code, required in ends)
    (tmp_path / "events").write_text("".join(f"{line}\n" for line in lines))
    assert [is_failure(event) for event in events.new()] == [False, True, True, True, True]
    events.close()


def test_arguments_with_an_open_quote_are_words() -> None:
    assert words_of("-e 'ode /a/yard.world") == ["-e", "'ode", "/a/yard.world"]
