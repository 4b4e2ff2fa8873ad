"""Packages of ROS 2 in source: their build type, and the entry points of those in Python. No code of them is run."""

from __future__ import annotations

import ast
import configparser
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

from sim_action.core.files import read_at_most
from sim_action.core.records import dataclass
from sim_action.robot.documents.package_search import PACKAGE_FILE

UNREADABLE: Final = "unknown"
"""The build type if package.xml is not valid XML."""

_PYTHON: Final = "ament_python"
_GROUP: Final = "console_scripts"
_MAX_FILE_BYTES: Final = 1_000_000
_NAME: Final = re.compile(r"[\w.-]+")
_ENTRY: Final = re.compile(r"[^\W\d]\w*(?:\.[^\W\d]\w*)*(?::[^\W\d]\w*(?:\.[^\W\d]\w*)*)?")


@dataclass(frozen=True, slots=True)
class PythonPackage:
    """A package in source. All but name, folder and build type are empty unless it is in Python.

    Attributes:
        build_type: as in package.xml, such as "ament_python" or "ament_cmake".
        entry_points: name of a console script -> its function, such as "my_robot.mover:main".
        scripts: programs that are installed as they are.
        modules: the folder of its Python modules.
        unread: the file whose entry points are computed by code, and could not be read; empty: all were read.
    """

    name: str
    folder: Path
    build_type: str
    entry_points: Mapping[str, str]
    scripts: tuple[Path, ...]
    modules: Path
    unread: str = ""

    @property
    def is_python(self) -> bool:
        """True if the package can be run without a build."""
        return self.build_type == _PYTHON


def read_package(name: str, folder: Path) -> PythonPackage:
    """Return the package in a folder."""
    build_type = _build_type(folder)
    if build_type != _PYTHON:
        return PythonPackage(name, folder, build_type, {}, (), folder)
    setup = _Setup(_syntax(folder / "setup.py"))
    entries = {**_project_scripts(folder), **_configured(folder), **dict(_parsed(setup.entries()))}
    scripts = [folder / script for script in setup.scripts()]
    modules = setup.package_root()
    own = tuple(path for path in scripts if _is_in(path, folder) and path.is_file())
    return PythonPackage(
        name, folder, build_type, entries, own, folder / modules, "setup.py" if setup.is_computed else ""
    )


def _build_type(folder: Path) -> str:
    """Return the build type in package.xml; without one, the one that its build files suggest."""
    try:
        root = ET.fromstring(_content(folder / PACKAGE_FILE))  # noqa: S314 - of the user's own package
    except ET.ParseError:
        return UNREADABLE
    stated = (root.findtext("export/build_type") or "").strip()
    is_python = (folder / "setup.py").is_file() and not (folder / "CMakeLists.txt").exists()
    return stated or (_PYTHON if is_python else "ament_cmake")


def _content(path: Path) -> bytes:
    """Return the content of a file of a package; a link out of it is not read."""
    try:
        return (read_at_most(path, _MAX_FILE_BYTES) or b"") if _is_in(path, path.parent) else b""
    except OSError:
        return b""


def _is_in(path: Path, folder: Path) -> bool:
    try:
        return path.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError):  # a loop of links
        return False


def _parsed(lines: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Yield name and function of entry points such as "mover = my_robot.mover:main"."""
    for line in lines:
        name, equals, entry = (part.strip() for part in line.partition("="))
        entry = entry.partition("[")[0].strip()
        if equals and _NAME.fullmatch(name) and _ENTRY.fullmatch(entry):
            yield name, entry


def _configured(folder: Path) -> dict[str, str]:
    """Return the entry points in setup.cfg."""
    parser = configparser.ConfigParser(interpolation=None, strict=False)
    try:
        parser.read_string(_content(folder / "setup.cfg").decode(errors="replace"))
    except configparser.Error:
        return {}
    return dict(_parsed(parser.get("options.entry_points", _GROUP, fallback="").splitlines()))


def _project_scripts(folder: Path) -> dict[str, str]:
    """Return the entry points in pyproject.toml."""
    try:
        project = tomllib.loads(_content(folder / "pyproject.toml").decode(errors="replace")).get("project", {})
    except tomllib.TOMLDecodeError:
        return {}
    scripts = project.get("scripts", {}) if isinstance(project, dict) else {}
    return dict(_parsed(f"{name} = {entry}" for name, entry in scripts.items())) if isinstance(scripts, dict) else {}


def _syntax(path: Path) -> ast.Module:
    try:
        return ast.parse(_content(path))
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return ast.Module([], [])


class _Setup:
    """The arguments of setup() in a setup.py, as far as they are constants or made of constants."""

    def __init__(self, module: ast.Module) -> None:
        self.is_computed = False
        self._names: dict[str, ast.expr] = {}
        self._given: dict[str, ast.expr] = {}
        for node in module.body:
            if isinstance(node, ast.Assign):
                self._names |= {target.id: node.value for target in node.targets if isinstance(target, ast.Name)}
        for each in ast.walk(module):
            if isinstance(each, ast.Call) and ast.unparse(each.func).rpartition(".")[2] == "setup":
                self._given |= {keyword.arg: keyword.value for keyword in each.keywords if keyword.arg}
                # Arguments in a dictionary.
                self.is_computed |= any(keyword.arg is None for keyword in each.keywords)

    def entries(self) -> list[str]:
        """Return the console scripts."""
        found = self._value(self._given.get("entry_points"))
        if isinstance(found, str):
            parser = configparser.ConfigParser(interpolation=None, strict=False)
            try:
                parser.read_string(found)
            except configparser.Error:
                return []
            return [f"{name} = {entry}" for name, entry in parser[_GROUP].items()] if _GROUP in parser else []
        group = found.get(_GROUP, []) if isinstance(found, dict) else []
        lines = group.splitlines() if isinstance(group, str) else group
        return [line for line in lines if isinstance(line, str)] if isinstance(lines, list) else []

    def scripts(self) -> list[str]:
        """Return the paths of the programs that are installed as they are."""
        found = self._value(self._given.get("scripts"))
        return [path for path in found if isinstance(path, str)] if isinstance(found, list) else []

    def package_root(self) -> str:
        """Return the folder of the modules, from the folder of the package."""
        found = self._value(self._given.get("package_dir"))
        root = found.get("", "") if isinstance(found, dict) else ""
        return root if isinstance(root, str) else ""

    def _value(self, node: ast.expr | None, depth: int = 20) -> object:
        """Return the value of an expression; None if it would have to be run."""
        found: object = None
        if depth == 0 or node is None:
            return found
        match node:
            case ast.Constant(value=value):
                found = value
            case ast.Name(id=name) if name in self._names:
                found = self._value(self._names[name], depth - 1)
            case ast.List(elts=parts) | ast.Tuple(elts=parts):
                found = [self._value(part, depth - 1) for part in parts]
            case ast.Dict(keys=keys, values=values):
                pairs = zip(keys, values, strict=True)
                found = {str(self._value(key, depth - 1)): self._value(value, depth - 1) for key, value in pairs}
            case ast.JoinedStr(values=parts):
                found = self._joined([self._value(part, depth - 1) for part in parts])
            case ast.FormattedValue(value=inner, conversion=-1, format_spec=None):
                found = self._value(inner, depth - 1)
            case ast.BinOp(left=left, op=ast.Add(), right=right):
                found = self._joined([self._value(left, depth - 1), self._value(right, depth - 1)])
            case _:
                self.is_computed = True
        return found

    def _joined(self, parts: list[object]) -> object:
        if all(isinstance(part, str) for part in parts):
            return "".join(map(str, parts))
        if all(isinstance(part, list) for part in parts):
            return [each for part in parts if isinstance(part, list) for each in part]
        self.is_computed = True
        return None
