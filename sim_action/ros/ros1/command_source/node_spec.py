"""The keys below `ros1`: nodes with their start options, and the launch file that starts them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import PurePosixPath
from typing import Annotated, Any, Final
from xml.etree import ElementTree as ET

import yaml
from pydantic import AfterValidator, BeforeValidator, Field, GetJsonSchemaHandler, JsonValue, model_validator
from pydantic_core import CoreSchema

from sim_action.core.field_types import FrozenModel, NamesFile, PositiveSeconds
from sim_action.ros.launches import with_lists

# In s: as long as anybody can mean.
_MAX_START_S: Final = 86_400
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


class NodeSpec(FrozenModel):
    """A node: a program of a package, and its start options."""

    package: Annotated[str, Field(min_length=1, description="package of the program")]
    type: Annotated[
        str, Field(min_length=1, description="file of the program, such as mover.py, or its name if it is compiled")
    ]
    name: Annotated[
        BaseName | None, Field(description="name of the node; default: the file name without its suffix")
    ] = None
    args: Annotated[str, Field(description="arguments of the program, as in a launch file")] = ""
    params: Annotated[
        dict[str, JsonValue], BeforeValidator(with_lists), Field(description="private parameters of the node")
    ] = Field(default_factory=dict)
    remap: Annotated[
        dict[GraphName, GraphName], Field(description="name that the node uses -> name that replaces it")
    ] = Field(default_factory=dict)
    namespace: Annotated[GraphName | None, Field(description="namespace of the node")] = None
    required: Annotated[bool, Field(description="if true, the run fails when this node ends")] = False

    @model_validator(mode="before")
    @classmethod
    def _spelled_out(cls, value: Any) -> Any:
        """Expand the short form of a node. Raises ValueError."""
        if not isinstance(value, str):
            return value
        package, slash, kind = value.partition("/")
        if not (package and slash and kind):
            raise ValueError(f"the short form of a node is package/type, such as my_robot/mover.py, found '{value}'")
        return {"package": package, "type": kind}

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Add the short form of a node, a text, to the schema."""
        full = handler.resolve_ref_schema(handler(schema))
        full.pop("title", None)
        return {"anyOf": [{"type": "string", "pattern": r"^[^/]+/[\s\S]"}, full]}

    @property
    def called(self) -> str:
        """The name of the node."""
        plain = re.sub(r"\W", "_", PurePosixPath(self.type).stem)
        return self.name or (plain if plain[:1].isalpha() else f"node_{plain}")


class RosNodes(FrozenModel):
    """The nodes to launch, and the names of the robot's topics."""

    launch: Annotated[
        tuple[str, ...] | None,
        Field(min_length=1, description="launch file: its package, its name, and NAME:=VALUE for each argument"),
    ] = None
    nodes: Annotated[
        tuple[NodeSpec, ...] | None,
        Field(min_length=1, description="list of nodes, instead of a launch file; each is a map or package/type"),
    ] = None
    allow_losses: Annotated[
        bool, Field(description="run without parts of the launch file that are not simulated; they are warnings then")
    ] = False
    workspace: Annotated[
        str | None,
        NamesFile(),
        Field(
            min_length=1,
            description="folder of the catkin workspace; default: the nearest one around the scenario, else its "
            "repository",
        ),
    ] = None
    topics: Annotated[
        dict[str, GraphName], Field(description="cmd_vel, odom, joint_states, or the name of a sensor -> topic name")
    ] = Field(default_factory=dict)
    start_within: Annotated[
        PositiveSeconds,
        Field(le=_MAX_START_S, description="wall time that nodes may take to start; sim time waits for them"),
    ] = 10.0


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
