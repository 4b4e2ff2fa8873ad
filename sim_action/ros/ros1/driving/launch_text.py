"""Nodes of a scenario as a launch file (wiki.ros.org/roslaunch/XML)."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree as ET

import yaml

from sim_action.ros.ros1.driving.node_spec import NodeSpec


def launch_text(nodes: Iterable[NodeSpec]) -> str:
    """What roslaunch is given in place of a file of the user's."""
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
        # `from` is a word of Python's.
        ET.SubElement(element, "remap", {"from": name, "to": other})
    if node.params:
        # As the same library writes it that roslaunch reads it by: to YAML 1.1, the 1e-6 of JSON is text.
        ET.SubElement(element, "rosparam").text = yaml.safe_dump(node.params)
