"""Read the joints that `<ros2_control>` and `<transmission>` drive, and the controllers in parameter files.

Formats: control.ros.org ("URDF additions", "Parameters" of the controllers), wiki.ros.org/urdf/XML/Transmission.
Plugins of Gazebo that run ros2_control name their parameter files in `<parameters>`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any, Final
from xml.etree.ElementTree import Element

from sim_action.core.errors import Location
from sim_action.core.files import read_at_most
from sim_action.core.records import replace
from sim_action.robot.documents.packages import PackageError, Packages
from sim_action.robot.documents.xml_document import ModelDocument, shown_file
from sim_action.robot.model.robot_model import CommandedJoint, Plugin

MAX_PARAMETER_BYTES: Final = 1_000_000  # the largest size of a parameter file
_MAX_DEPTH: Final = 20
_MAX_VALUES: Final = 10_000
_MAX_KEY: Final = 200
_MAX_CONTROLLERS: Final = 1_000
_MAX_FILES: Final = 10
_TAGS: Final = frozenset(f"tag:yaml.org,2002:{kind}" for kind in ("str", "int", "float", "bool", "null", "seq", "map"))
_CONTROL_PLUGIN: Final = re.compile(r"gazebo_ros2_control|(gz|ign|ignition)_ros2_control-system")
_FIND: Final = re.compile(r"\$\(find ([^)\s]+)\)/")
_INTERFACE: Final = re.compile(r"(position|velocity|effort)\w*jointinterface")
_PARAMETERS: Final = "ros__parameters"


def commanded_joints(document: ModelDocument) -> tuple[CommandedJoint, ...]:
    """Return the joints with command interfaces, in the order of the file."""
    joints: list[CommandedJoint] = []
    for joint in document.elements("ros2_control/joint"):
        named = frozenset(tag.get("name", "").lower() for tag in joint.findall("command_interface"))
        if named:
            joints.append(CommandedJoint(joint.get("name", ""), named, "ros2_control", document.places[joint]))
    for transmission in document.elements("transmission"):
        for joint in transmission.findall("joint"):
            named = frozenset(map(_kind, interfaces_of(transmission, joint)))
            joints.append(CommandedJoint(joint.get("name", ""), named, "transmission", document.places[joint]))
    return tuple(joints)


def interfaces_of(transmission: Element, joint: Element) -> Iterator[str]:
    """Yield the interfaces of a joint, stated there or at its actuator, with the package that old files leave out."""
    at_joint = joint.findall("hardwareInterface")
    for tag in at_joint or transmission.findall("actuator/hardwareInterface"):
        name = (tag.text or "").strip()
        yield name if "/" in name else f"hardware_interface/{name}"


def _kind(interface: str) -> str:
    name = interface.rpartition("/")[2].lower()
    match = _INTERFACE.fullmatch(name)
    return match[1] if match else name


def with_controllers(plugins: tuple[Plugin, ...], path: Path, packages: Packages) -> tuple[Plugin, ...]:
    """Return the plugins of a model, and the controllers in their parameter files, each of which is read once."""
    model_plugins = list[Plugin]()
    read = dict[Path, tuple[Plugin, ...] | str]()
    for plugin in plugins:
        unread = []
        references = plugin.texts("parameters") if _CONTROL_PLUGIN.fullmatch(plugin.name) else ()
        for reference in islice(dict.fromkeys(references), _MAX_FILES + 1):
            try:
                file = packages.resolve(_FIND.sub(r"package://\1/", reference), path).path
            except PackageError as error:
                unread.append(str(error))
                continue
            if file not in read:
                read[file] = _read(file) if len(read) < _MAX_FILES else f"a model has at most {_MAX_FILES} of them"
            if isinstance(problem := read[file], str):
                unread.append(problem)
        model_plugins.append(replace(plugin, unread=tuple(unread)))
    return (
        *model_plugins,
        *(plugin for plugins in read.values() if not isinstance(plugins, str) for plugin in plugins),
    )


def _read(path: Path) -> tuple[Plugin, ...] | str:
    """Return the controllers in a parameter file, or the reason why it cannot be read."""
    try:
        return controllers_in(path)
    except ValueError as error:
        return str(error)


def controllers_in(path: Path) -> tuple[Plugin, ...]:
    """Return the controllers with a type in a parameter file of ROS. Raises ValueError if it cannot be read."""
    import yaml

    shown = shown_file(path)
    lines: dict[str, int] = {}
    try:
        data = read_at_most(path, MAX_PARAMETER_BYTES)
        if data is not None:
            tree = _tree(yaml, data.decode(), lines)
    except (OSError, ValueError, OverflowError, yaml.YAMLError) as error:
        reason = next(iter(str(error).splitlines()), type(error).__name__)
        raise ValueError(f"'{shown}' cannot be read as YAML: {reason}") from None
    if data is None:
        raise ValueError(f"'{shown}' is larger than {MAX_PARAMETER_BYTES // 1_000_000} MB")
    types: dict[str, str] = {}
    values: dict[str, dict[str, Any]] = {}
    for name, parameters in _nodes(tree, ""):
        own = values.setdefault(name, {})
        own.update(parameters)
        if isinstance(kind := parameters.get("type"), str) and any(map(str.isalpha, kind)):
            types[name] = kind
    controllers, left = list[Plugin](), _MAX_VALUES
    for name, kind in islice(types.items(), _MAX_CONTROLLERS):
        flat = tuple(islice(_flat(values[name], ""), left))
        left -= len(flat)
        controllers.append(Plugin(kind, flat, name, Location(shown, lines.get(name))))
    return tuple(controllers)


def _tree(yaml: Any, text: str, lines: dict[str, int]) -> object:
    """Return the content of a YAML file; each single value is its text. Raises ValueError.

    :param lines: gets the last line of each key, without its namespace: parameters of a node follow its type.
    """
    root: list[Any] = []
    open_: list[dict[str, Any] | list[Any]] = [root]
    keys: list[str | None] = [None]
    for event in _checked(yaml, text):
        inner, key = open_[-1], keys[-1]
        if isinstance(event, yaml.CollectionEndEvent):
            open_.pop()
            keys.pop()
        elif isinstance(inner, dict) and key is None:
            line = event.start_mark.line + 1
            if not isinstance(event, yaml.ScalarEvent) or len(event.value) > _MAX_KEY:
                raise ValueError(f"line {line}: a key must be a text of at most {_MAX_KEY} characters")
            keys[-1] = event.value
            lines[event.value.rpartition("/")[2]] = line
        else:
            collection: dict[str, Any] | list[Any] = {} if isinstance(event, yaml.MappingStartEvent) else []
            value = event.value if isinstance(event, yaml.ScalarEvent) else collection
            keys[-1] = None
            if isinstance(inner, dict):
                inner[str(key)] = value
            else:
                inner.append(value)
            if value is collection:
                open_.append(collection)
                keys.append(None)
    return root[0] if root else None


def _checked(yaml: Any, text: str) -> Iterator[Any]:
    """Yield the bounded events of one YAML document without tags and aliases. Raises ValueError."""
    count = depth = documents = 0
    for event in yaml.parse(text, Loader=yaml.SafeLoader):
        count += isinstance(event, yaml.NodeEvent)
        documents += isinstance(event, yaml.DocumentStartEvent)
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        problem = ""
        if isinstance(event, yaml.AliasEvent):
            problem = "it has YAML aliases, which are not read in parameter files"
        elif count > 2 * _MAX_VALUES or depth > _MAX_DEPTH or documents > 1:
            problem = f"at most {_MAX_VALUES:,} values, {_MAX_DEPTH} levels and one document are read"
        elif getattr(event, "tag", None) not in (None, "!", *_TAGS):
            problem = "a tag is not read in parameter files; remove it"
        if problem:
            raise ValueError(f"line {event.start_mark.line + 1}: {problem}")
        if isinstance(event, yaml.NodeEvent | yaml.CollectionEndEvent):
            yield event


def _nodes(tree: object, name: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield nodes with their parameters; in ROS 2 the manager states the types of its controllers."""
    if not isinstance(tree, dict):
        return
    if isinstance(stated := tree.get(_PARAMETERS), dict):
        yield name, stated
    elif isinstance(tree.get("type"), str):
        yield name, tree
    for key, below in tree.items():
        yield from _nodes(below, name if key == _PARAMETERS else key.rpartition("/")[2])


def _flat(tree: object, name: str) -> Iterator[tuple[str, str]]:
    """Yield (name, text) of each value; nested names are joined with dots."""
    if isinstance(tree, dict):
        for key, below in tree.items():
            yield from _flat(below, f"{name}.{key}" if name else key)
    elif isinstance(tree, list):
        for item in tree:
            yield from _flat(item, name)
    else:
        yield name, str(tree)
