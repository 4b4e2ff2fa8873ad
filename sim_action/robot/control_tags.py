"""Read the joints that `<ros2_control>` and `<transmission>` drive, and the controllers in parameter files.

Formats: control.ros.org ("URDF additions", "Parameters" of the controllers), wiki.ros.org/urdf/XML/Transmission.
Plugins of Gazebo that run ros2_control name their parameter files in `<parameters>`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final
from xml.etree.ElementTree import Element

from sim_action.core.errors import Location
from sim_action.core.files import read_at_most
from sim_action.robot.packages import PackageError, Packages
from sim_action.robot.robot_model import CommandedJoint, Plugin
from sim_action.robot.xml_document import ModelDocument, shown_file

MAX_PARAMETER_BYTES: Final = 1_000_000
"""The largest size of a parameter file."""

_MAX_DEPTH: Final = 20
_MAX_VALUES: Final = 10_000

_CONTROL_PLUGIN: Final = re.compile(r"gazebo_ros2_control|(gz|ign|ignition)_ros2_control-system")
_FIND: Final = re.compile(r"\$\(find ([^)\s]+)\)/")
_INTERFACE: Final = re.compile(r"(position|velocity|effort)\w*jointinterface")
_PARAMETERS: Final = "ros__parameters"


def commanded_joints(document: ModelDocument) -> tuple[CommandedJoint, ...]:
    """Return the joints with command interfaces, in the order of the file."""
    found: list[CommandedJoint] = []
    for joint in document.elements("ros2_control/joint"):
        named = frozenset(tag.get("name", "").lower() for tag in joint.findall("command_interface"))
        if named:
            found.append(CommandedJoint(joint.get("name", ""), named, "ros2_control", document.places[joint]))
    for transmission in document.elements("transmission"):
        for joint in transmission.findall("joint"):
            named = frozenset(map(_kind, interfaces_of(transmission, joint)))
            found.append(CommandedJoint(joint.get("name", ""), named, "transmission", document.places[joint]))
    return tuple(found)


def interfaces_of(transmission: Element, joint: Element) -> Iterator[str]:
    """Yield the interfaces of a joint of a transmission, with the package that old descriptions leave out.

    The interface is named at the joint, in older descriptions at the actuator.
    """
    at_joint = joint.findall("hardwareInterface")
    for tag in at_joint or transmission.findall("actuator/hardwareInterface"):
        name = (tag.text or "").strip()
        yield name if "/" in name else f"hardware_interface/{name}"


def _kind(interface: str) -> str:
    """Return "velocity" for "hardware_interface/VelocityJointInterface"; other names as they are, in lower case."""
    name = interface.rpartition("/")[2].lower()
    known = _INTERFACE.fullmatch(name)
    return known[1] if known else name


def with_controllers(plugins: tuple[Plugin, ...], path: Path, packages: Packages) -> tuple[Plugin, ...]:
    """Return the plugins, and the controllers in the parameter files that they name.

    :param path: the file of the model.
    """
    found, controllers = list[Plugin](), list[Plugin]()
    for plugin in plugins:
        unread = []
        for reference in plugin.texts("parameters") if _CONTROL_PLUGIN.fullmatch(plugin.name) else ():
            try:
                controllers += controllers_in(_file(reference, path, packages))
            except (PackageError, ValueError) as error:
                unread.append(str(error))
        found.append(replace(plugin, unread=tuple(unread)))
    return (*found, *controllers)


def _file(reference: str, path: Path, packages: Packages) -> Path:
    """Return the path of a parameter file. Raises PackageError."""
    return packages.resolve(_FIND.sub(r"package://\1/", reference), path).path


def controllers_in(path: Path) -> tuple[Plugin, ...]:
    """Return the controllers with a type in a parameter file of ROS. Raises ValueError if it cannot be read."""
    import yaml

    shown = shown_file(path)
    try:
        data = read_at_most(path, MAX_PARAMETER_BYTES)
        if data is None:
            raise ValueError(f"'{shown}' is larger than {MAX_PARAMETER_BYTES // 1_000_000} MB")
        text = data.decode()
        _refuse_aliases(yaml, text, shown)
        tree = yaml.safe_load(text)
    except (OSError, UnicodeDecodeError, yaml.YAMLError, RecursionError) as error:
        raise ValueError(f"'{shown}' cannot be read as YAML: {str(error).splitlines()[0]}") from None
    types: dict[str, str] = {}
    values: dict[str, dict[str, Any]] = {}
    for name, parameters in _nodes(tree, "", 0):
        own = values.setdefault(name, {})
        own.update(parameters)
        if isinstance(kind := parameters.get("type"), str):
            types[name] = kind
    return tuple(
        Plugin(kind, tuple(_flat(values[name], "", 0))[:_MAX_VALUES], name, Location(shown, _line(text, name)))
        for name, kind in types.items()
    )


def _refuse_aliases(yaml: Any, text: str, shown: str) -> None:
    """Raise ValueError for a file with aliases, whose values may be many more than its bytes."""
    if any(isinstance(event, yaml.AliasEvent) for event in yaml.parse(text, Loader=yaml.SafeLoader)):
        raise ValueError(f"'{shown}' has YAML aliases, which are not read in parameter files")


def _nodes(tree: object, name: str, depth: int) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield nodes with their parameters; in ROS 2 the manager states the types of its controllers."""
    if not isinstance(tree, dict) or depth > _MAX_DEPTH:
        return
    if isinstance(stated := tree.get(_PARAMETERS), dict):
        yield name, stated
    elif isinstance(tree.get("type"), str):
        yield name, tree
    for key, below in tree.items():
        yield from _nodes(below, name if key == _PARAMETERS else str(key).rpartition("/")[2], depth + 1)


def _flat(tree: object, name: str, depth: int) -> Iterator[tuple[str, str]]:
    """Yield (name, text) of each value; nested names are joined with dots."""
    if isinstance(tree, dict):
        if depth < _MAX_DEPTH:
            for key, below in tree.items():
                yield from _flat(below, f"{name}.{key}" if name else str(key), depth + 1)
    elif isinstance(tree, list):
        for item in tree:
            yield from _flat(item, name, depth + 1)
    else:
        yield name, str(tree)


def _line(text: str, name: str) -> int | None:
    """Return the last line that begins with the name as a key: its parameters follow its type."""
    lines = text.split("\n")
    keys = (f"{name}:", f'"{name}":', f"'{name}':", f"/{name}:")
    found = [number for number, line in enumerate(lines, 1) if line.strip().startswith(keys)]
    return found[-1] if found else None
