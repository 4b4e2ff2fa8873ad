"""The keys below `ros1`: nodes with their start options, and the launch file that starts them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import PurePosixPath
from typing import Annotated, ClassVar, Final
from xml.etree import ElementTree as ET

import yaml
from pydantic import AfterValidator, BeforeValidator, Field, JsonValue
from typing_extensions import override

from sim_action.core.yaml_document import plain_data
from sim_action.ros.launches import ListedNode, Nodes, StartTime

_BASE: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_GRAPH: Final = re.compile(r"[~/]?[A-Za-z][A-Za-z0-9_]*(?:/[A-Za-z0-9_]+)*")


def _base_name(name: str) -> str:
    if not _BASE.fullmatch(name):
        raise ValueError(f"the name of a node has letters, digits and '_' and starts with a letter, found {name!r}")
    return name


def _graph_name(name: str) -> str:
    if not _GRAPH.fullmatch(name):
        raise ValueError(f"a name in ROS has letters, digits, '_' and '/', such as /arm/cmd_vel, found {name!r}")
    return name


BaseName = Annotated[str, AfterValidator(_base_name)]
GraphName = Annotated[str, AfterValidator(_graph_name)]


class NodeSpec(ListedNode):
    """A node: a program of a package, and its start options."""

    short_form: ClassVar[str] = r"^[^/]+/[\s\S]"

    package: Annotated[str, Field(min_length=1, description="package of the program")]
    type: Annotated[
        str, Field(min_length=1, description="file of the program, such as mover.py, or its name if it is compiled")
    ]
    name: Annotated[
        BaseName | None, Field(description="name of the node; default: the file name without its suffix")
    ] = None
    args: Annotated[str, Field(description="arguments of the program, as in a launch file")] = ""
    params: Annotated[
        dict[str, JsonValue], BeforeValidator(plain_data), Field(description="private parameters of the node")
    ] = Field(default_factory=dict)
    remap: Annotated[
        dict[GraphName, GraphName], Field(description="name that the node uses -> name that replaces it")
    ] = Field(default_factory=dict)
    namespace: Annotated[GraphName | None, Field(description="namespace of the node")] = None
    required: Annotated[bool, Field(description="if true, the run fails when this node ends")] = False

    @classmethod
    @override
    def expanded(cls, text: str) -> dict[str, str]:
        package, slash, kind = text.partition("/")
        if not (package and slash and kind):
            raise ValueError(f"the short form of a node is package/type, such as my_robot/mover.py, found '{text}'")
        return {"package": package, "type": kind}

    @property
    def called(self) -> str:
        """The name of the node."""
        plain = re.sub(r"\W", "_", PurePosixPath(self.type).stem)
        return self.name or (plain if plain[:1].isalpha() else f"node_{plain}")


class RosNodes(Nodes[NodeSpec]):
    """The nodes to launch, and the names of the robot's topics."""

    topics: Annotated[
        dict[str, GraphName], Field(description="cmd_vel, odom, joint_states, or the name of a sensor -> topic name")
    ] = Field(default_factory=dict)
    start_within: StartTime = 10.0


def launch_text(nodes: Iterable[NodeSpec]) -> str:
    """Return the text of a launch file that starts the nodes (wiki.ros.org/roslaunch/XML)."""
    launch = ET.Element("launch")
    for node in nodes:
        _add(launch, node)
    ET.indent(launch)
    return ET.tostring(launch, encoding="unicode") + "\n"


def _add(launch: ET.Element, node: NodeSpec) -> None:
    element = ET.SubElement(launch, "node", pkg=node.package, type=node.type, name=node.called)
    if node.args:
        element.set("args", node.args)
    if node.namespace:
        element.set("ns", node.namespace)
    if node.required:
        element.set("required", "true")
    for name, other in node.remap.items():
        # `from` is a keyword of Python.
        ET.SubElement(element, "remap", {"from": name, "to": other})
    if node.params:
        # roslaunch reads it with the same library. JSON would not do: its 1e-6 is text in YAML 1.1.
        ET.SubElement(element, "rosparam").text = yaml.safe_dump(node.params)
