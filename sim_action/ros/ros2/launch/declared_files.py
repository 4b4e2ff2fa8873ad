"""The readers of launch files in Python, XML and YAML, for a ROS 2 without `launch`."""

from __future__ import annotations

import importlib
import runpy
import sys
from importlib.abc import Loader
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import GenericAlias, ModuleType
from typing import Any
from xml.parsers import expat

import yaml

from sim_action.ros.ros2.launch.declared_parts import parsed, split
from sim_action.ros.ros2.launch.declared_table import (
    ACTIONS,
    KINDS,
    Context,
    Kind,
    LaunchError,
    Part,
    Substitution,
    unsupported,
)

_ROOTS = ("launch", "launch_ros", "launch_xml", "launch_yaml")
_SCALARS = {"str": str, "int": int, "float": float, "bool": bool}
_TYPES: dict[Any, Any] = {None: None, "yaml": None, **_SCALARS}
_TYPES |= {f"list_of_{name}": GenericAlias(list, (kind,)) for name, kind in _SCALARS.items()}


def read_file(path: Path) -> Any:
    """Return the actions of a launch file. Raise LaunchError, or what code of a launch file raises."""
    if path.suffix == ".py":
        content = runpy.run_path(str(path))
        if "generate_launch_description" not in content:
            raise LaunchError("InvalidLaunchFile", f"{path} has no function generate_launch_description")
        return content["generate_launch_description"]()
    root = _read_yaml(path) if path.suffix in (".yaml", ".yml") else _read_xml(path)
    root.attributes.pop("version", None)
    for name in root.attributes:
        raise unsupported(f"'{name}' of <launch>")
    return [child.action() for child in root.children]


# Launch files in Python import these modules.


_HELPERS: dict[str, dict[str, Any]] = {
    "launch": {"LaunchContext": Context, "Substitution": Substitution},
    "launch.substitution": {"Substitution": Substitution},
    "launch.launch_context": {"LaunchContext": Context},
    "launch.utilities": {
        "normalize_to_list_of_substitutions": lambda subs: subs if isinstance(subs, (list, tuple)) else [subs],
        "perform_substitutions": lambda context, subs: context.perform_substitution(subs),
    },
}
"""Module -> what packages with substitutions of their own need of it."""

_REFUSED = {
    "launch.actions": "OpaqueCoroutine PopEnvironment PopLaunchConfigurations PushEnvironment PushLaunchConfigurations "
    "ResetEnvironment ResetLaunchConfigurations UnregisterEventHandler",
    "launch.event_handlers": "OnExecutionComplete OnProcessIO",
    "launch.substitutions": "LaunchLogDir LocalSubstitution",
    "launch_ros.actions": "ComposableNodeContainer LifecycleNode LifecycleTransition LoadComposableNodes SetROSLogDir",
    "launch_ros.descriptions": "ComposableNode",
    "launch_ros.event_handlers": "OnStateTransition",
}
"""Module -> the names that `from MODULE import *` brings, and that only `launch` understands."""


class _Finder(Loader):
    """Finds every module of `launch` and `launch_ros`."""

    def find_spec(self, name: str, _path: Any = None, _target: Any = None) -> ModuleSpec | None:
        """Return the module of a name."""
        return ModuleSpec(name, self, is_package=True) if name.partition(".")[0] in _ROOTS else None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Return an empty module."""
        return _Module(spec.name)

    def exec_module(self, module: ModuleType) -> None:
        """Put the rows of the table into a module."""
        rows = {name.rpartition(".")[2]: kind for name, kind in KINDS.items() if _module_of(name) == module.__name__}
        refused = {name: getattr(module, name) for name in _REFUSED.get(module.__name__, "").split()}
        vars(module).update(rows, **refused, **_HELPERS.get(module.__name__, {}))
        vars(module)["__all__"] = [name for name in vars(module) if not name.startswith("_")]


def _module_of(name: str) -> str:
    return name.rpartition(".")[0]


class _Module(ModuleType):
    """A module of `launch`; names that are not in the table are refused when an action of theirs runs."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        if name.islower():
            return importlib.import_module(f"{self.__name__}.{name}")
        # `launch.substitutions.text_substitution` has what `launch.substitutions` has.
        return KINDS.get(f"{_module_of(self.__name__)}.{name}") or _unknown(f"'{name}' of {self.__name__}")

    def __call__(self, *args: Any, **words: Any) -> Part:
        return _unknown(f"'{self.__name__}'")(*args, **words)


def _unknown(name: str) -> Kind:
    """Return a row whose parts are refused when they run."""

    def refuse(_: Any, *_args: Any, **_words: Any) -> None:
        raise unsupported(name)

    return Kind(name, refuse)


def install_modules() -> None:
    """Let launch files in Python import `launch` and `launch_ros`, of which only the table is there."""
    sys.meta_path.insert(0, _Finder())


# Launch files in XML and YAML.


class _Element:
    """An element of a file; values of attributes are texts in XML, and have types in YAML."""

    def __init__(self, tag: str, place: tuple[str, int], *, is_typed: bool = False) -> None:
        self.tag, self.place, self._is_typed = tag, place, is_typed
        self.attributes: dict[str, Any] = {}
        self.children: list[_Element] = []

    def action(self) -> Part:
        """Return the action; its faults are errors when it runs."""
        kind, names = ACTIONS.get(self.tag, (None, {}))
        if kind is None:
            return _unknown(f"the element <{self.tag}>").part((), {"condition": self._condition()}, self.place)
        part = kind.part((), lambda: self._words(names), self.place)
        part.condition = self._condition()
        return part

    def _condition(self) -> Part | None:
        for name, kind in (("if", "IfCondition"), ("unless", "UnlessCondition")):
            if name in self.attributes:
                return KINDS[f"launch.conditions.{kind}"].part((_text(str(self.attributes[name])),))
        return None

    def _words(self, names: dict[str, str]) -> dict[str, Any]:
        """Return the arguments of the action. Raise LaunchError."""
        words: dict[str, Any] = {}
        for name, value in self.attributes.items():
            if name in ("if", "unless"):
                continue
            if name not in names or names[name] in _CHILDREN:
                raise unsupported(f"'{name}' of <{self.tag}>")
            words[names[name]] = self._value(names[name], value)
        if "actions" in names:
            words["actions"] = [child.action() for child in self.children if child.tag not in names]
        for child in self.children:
            if child.tag in names:
                _CHILDREN[names[child.tag]](child, words)
            elif "actions" not in names:
                raise unsupported(f"<{child.tag}> in <{self.tag}>")
        return words

    def _value(self, word: str, value: Any) -> Any:
        if word == "on_exit":
            if value != "shutdown":
                raise unsupported(f"on_exit '{value}'")
            return KINDS["launch.actions.Shutdown"].part()
        text = str(value)
        return split(parsed(text)) if word in ("arguments", "ros_arguments", "cmd") else _text(text)

    def take(self, *names: str) -> list[Any]:
        """Return the texts of all attributes. Raise LaunchError if others are there, or one is missing."""
        for name in self.attributes:
            if name not in names:
                raise unsupported(f"'{name}' of <{self.tag}>")
        for name in names:
            if name not in self.attributes:
                raise LaunchError("MissingAttribute", f"<{self.tag}> needs '{name}'")
        for child in self.children:
            raise unsupported(f"<{child.tag}> in <{self.tag}>")
        return [parsed(str(self.attributes[name])) for name in names]

    def add_parameter(self, words: dict[str, Any]) -> None:
        """Add a <param> to the parameters of a node."""
        listed = words.setdefault("parameters", [])
        if "from" in self.attributes:
            options = {"allow_substs": "false", **self.attributes}
            self.attributes = options
            file, allow = self.take("from", "allow_substs")
            listed.append(
                KINDS["launch_ros.parameter_descriptions.ParameterFile"].part((file,), {"allow_substs": allow})
            )
        else:
            listed.append(self.parameter())

    def parameter(self) -> dict[Any, Any]:
        """Return the name and value of a <param>. Raise LaunchError."""
        inner = [child for child in self.children if child.tag == "param"]
        if inner:
            self.children = [child for child in self.children if child.tag != "param"]
            (name,) = self.take("name")
            return {tuple(name): {key: value for child in inner for key, value in child.parameter().items()}}
        stated = {name: self.attributes.pop(name) for name in ("type", "value-sep", "value") if name in self.attributes}
        (name,) = self.take("name")
        kind = stated.get("type")
        if "value" not in stated:
            raise LaunchError("MissingAttribute", "<param> needs 'value'")
        if kind not in _TYPES:
            raise unsupported(f"the type '{kind}' of <param>")
        value = stated["value"]
        if "value-sep" in stated:
            value = [[_text(part)] for part in str(value).split(stated["value-sep"])]
        elif isinstance(value, list):
            value = [part if not isinstance(part, str) else _plain_or_text(part) for part in value]
        elif isinstance(value, str):
            value = _plain_or_text(value) if self._is_typed else _text(value)
        words = {"value_type": _TYPES[kind]}
        return {tuple(name): KINDS["launch_ros.parameter_descriptions.ParameterValue"].part((value,), words)}


def _text(text: str) -> Part:
    """Return a text whose substitutions are read when it is needed."""
    return Kind("text", lambda context, text: context.perform_substitution(parsed(text))).part((text,))


def _plain_or_text(text: str) -> Any:
    return _text(text) if "$(" in text else text


def _pairs(word: str, *names: str) -> Any:
    def add(child: _Element, words: dict[str, Any]) -> None:
        words.setdefault(word, []).append(tuple(child.take(*names)))

    return add


def _environment(word: str) -> Any:
    def add(child: _Element, words: dict[str, Any]) -> None:
        name, value = child.take("name", "value")
        words.setdefault(word, {})[tuple(name)] = value

    return add


_CHILDREN = {
    "choices": lambda child, words: words.setdefault("choices", []).append(child.take("value")[0]),
    "remappings": _pairs("remappings", "from", "to"),
    "launch_arguments": _pairs("launch_arguments", "name", "value"),
    "additional_env": _environment("additional_env"),
    "launch_configurations": _environment("launch_configurations"),
    "parameters": _Element.add_parameter,
}
"""Word of an action -> the function that adds a child of an element to the words."""


def _read_xml(path: Path) -> _Element:
    reader = expat.ParserCreate()
    stack = [_Element("", (str(path), 1))]

    def start(tag: str, attributes: dict[str, str]) -> None:
        element = _Element(tag, (str(path), reader.CurrentLineNumber))
        element.attributes = dict(attributes)
        stack[-1].children.append(element)
        stack.append(element)

    reader.StartElementHandler = start
    reader.EndElementHandler = lambda _: stack.pop()
    try:
        reader.Parse(path.read_bytes(), True)
    except expat.ExpatError as error:
        raise _wrong(path, error.lineno, f"it is not XML: {expat.ErrorString(error.code)}") from None
    return _root(stack[0], path)


def _read_yaml(path: Path) -> _Element:
    root = _Element("", (str(path), 1))
    try:
        node = yaml.compose(path.read_text(encoding="utf-8"), Loader=yaml.SafeLoader)
    except yaml.MarkedYAMLError as error:
        raise _wrong(
            path, error.problem_mark.line + 1 if error.problem_mark else 1, f"it is not YAML: {error.problem}"
        ) from None
    _add(root, node, str(path))
    return _root(root, path)


def _root(outer: _Element, path: Path) -> _Element:
    if [child.tag for child in outer.children] != ["launch"]:
        raise _wrong(path, 1, "its root must be 'launch'")
    return outer.children[0]


def _wrong(path: Path, line: int, message: str) -> LaunchError:
    error = LaunchError("InvalidLaunchFile", message)
    error.places = [(str(path), line)]
    return error


def _add(element: _Element, value: Any, file: str) -> None:
    """Add the keys of a mapping, or the actions of a list of mappings with one key each."""
    for mapping in value.value if isinstance(value, yaml.SequenceNode) else [value]:
        line = (value or yaml.ScalarNode("", "")).start_mark.line + 1 if value else 1
        if not isinstance(mapping, yaml.MappingNode):
            raise _wrong(Path(file), line, f"'{element.tag or 'the file'}' must have keys and values")
        for key, content in mapping.value:
            is_list = isinstance(content, yaml.SequenceNode)
            if isinstance(content, yaml.ScalarNode) or (
                is_list and content.value and isinstance(content.value[0], yaml.ScalarNode)
            ):
                element.attributes[str(key.value)] = yaml.SafeLoader("").construct_object(content, deep=True)
                continue
            if key.value == "children":
                _add(element, content, file)
                continue
            # `param: [{name: a}, {name: b}]` are two elements, and `group: [{node: ...}]` is one.
            several = is_list and key.value in _LISTS
            for part in content.value if several else [content]:
                child = _Element(str(key.value), (file, key.start_mark.line + 1), is_typed=True)
                _add(child, part, file)
                element.children.append(child)


_LISTS = frozenset({"choice", "remap", "arg", "env", "keep", "param"})
