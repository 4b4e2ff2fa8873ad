"""The packages of a ROS 2 workspace, installed by colcon or as sources, and their executables.

A package of build type ament_python needs no build: its entry points are read, and an overlay with a program for each
stands for its installation. Nor does one of ament_cmake that only installs programs in Python. All other packages must
be installed (`colcon build`).
No code of a package is run to read it.
"""

from __future__ import annotations

import ast
import configparser
import os
import re
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

from sim_action.core.files import content_or_empty
from sim_action.core.records import dataclass
from sim_action.core.wording import counted
from sim_action.core.workspace import PathError, Workspace
from sim_action.robot.documents.package_search import PACKAGE_FILE, folders_below
from sim_action.ros.launches import source_folder, workspace_folder
from sim_action.ros.ros2.installation import Ros2, packages_of_prefix, set_up

UNREADABLE: Final = "unknown"  # the build type if package.xml is not valid XML
_PYTHON: Final = "ament_python"
_GROUP: Final = "console_scripts"
_MAX_FILE_BYTES: Final = 1_000_000
# What makes a build necessary, and the programs that an installation has.
_BUILT: Final = re.compile(
    r"\b(?:\w+_)?(?:add_(?:executable|library|subdirectory|module)|rosidl_generate_interfaces"
    r"|generate_parameter_library|configure_file)\s*\(",
    re.IGNORECASE,
)
_INSTALLED: Final = re.compile(
    r"\binstall\s*\(\s*(?:PROGRAMS|FILES|DIRECTORY)\s+([^()]*?)\s+DESTINATION\s+\"?lib/([^()]*)\)", re.IGNORECASE
)
_NAME: Final = re.compile(r"[\w.-]+")
_ENTRY: Final = re.compile(r"[^\W\d]\w*(?:\.[^\W\d]\w*)*(?::[^\W\d]\w*(?:\.[^\W\d]\w*)*)?")
INSTALL: Final = "install"
BUILD: Final = "run colcon build"
_LAYOUT_FILE: Final = ".colcon_install_layout"
_INDEX: Final = "share/ament_index/resource_index/packages"
_LAUNCH_SUFFIXES: Final = (".py", ".xml", ".yaml", ".yml", ".launch")
_MAX_FIRST_LINE_BYTES: Final = 300
_OVERLAY: Final = "overlay"


@dataclass(frozen=True, slots=True)
class PythonPackage:
    """A package in source. All but name, folder and build type are empty unless it is in Python.

    `entry_points`: name -> function, such as "my_robot.mover:main". `scripts`: programs that are installed as they are.
    `unread`: the file whose entry points are computed by code, and could not be read. `has_only_scripts`: True if its
    build only installs programs in Python.
    """

    name: str
    folder: Path
    build_type: str
    entry_points: Mapping[str, str]
    scripts: tuple[Path, ...]
    modules: Path
    unread: str = ""
    has_only_scripts: bool = False

    @property
    def is_python(self) -> bool:
        """True if the package can be run without a build."""
        return self.build_type == _PYTHON or self.has_only_scripts

    @property
    def setup_file(self) -> str:
        """The file that names its programs, and how."""
        return "install(PROGRAMS ...) in CMakeLists.txt" if self.has_only_scripts else "console_scripts in setup.py"


def read_package(name: str, folder: Path) -> PythonPackage:
    """Return the package in a folder."""
    build_type = _build_type(folder)
    if build_type == "ament_cmake":
        return _cmake_package(name, folder)
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


def _cmake_package(name: str, folder: Path) -> PythonPackage:
    """Return a package of ament_cmake. Its programs are known if nothing has to be built."""
    text = re.sub(r"#.*", "", _content(folder / "CMakeLists.txt").decode(errors="replace"))
    scripts = list[Path]()
    unread = ""
    for words, more in _INSTALLED.findall(text.replace("${PROJECT_NAME}", name)):
        for word in words.replace('"', " ").split():
            files = _files(folder / word) if (folder / word).is_dir() else iter([folder / word])
            scripts += [path for path in files if _is_in(path, folder) and path.is_file()]
        unread = "CMakeLists.txt" if "$" in words or "RENAME" in more else unread
    has_only_scripts = bool(text.strip()) and not _BUILT.search(text) and all(map(is_python, scripts))
    return PythonPackage(name, folder, "ament_cmake", {}, tuple(scripts), folder, unread, has_only_scripts)


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
    return content_or_empty(path, _MAX_FILE_BYTES) if _is_in(path, path.parent) else b""


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
        self._setup_arguments: dict[str, ast.expr] = {}
        for statement in module.body:
            if isinstance(statement, ast.Assign):
                self._names |= {
                    target.id: statement.value for target in statement.targets if isinstance(target, ast.Name)
                }
        for node in ast.walk(module):
            if isinstance(node, ast.Call) and ast.unparse(node.func).rpartition(".")[2] == "setup":
                self._setup_arguments |= {keyword.arg: keyword.value for keyword in node.keywords if keyword.arg}
                # Arguments in a dictionary.
                self.is_computed |= any(keyword.arg is None for keyword in node.keywords)

    def entries(self) -> list[str]:
        """Return the console scripts."""
        entry_points = self._value(self._setup_arguments.get("entry_points"))
        if isinstance(entry_points, str):
            parser = configparser.ConfigParser(interpolation=None, strict=False)
            try:
                parser.read_string(entry_points)
            except configparser.Error:
                return []
            return [f"{name} = {entry}" for name, entry in parser[_GROUP].items()] if _GROUP in parser else []
        group = entry_points.get(_GROUP, []) if isinstance(entry_points, dict) else []
        lines = group.splitlines() if isinstance(group, str) else group
        return [line for line in lines if isinstance(line, str)] if isinstance(lines, list) else []

    def scripts(self) -> list[str]:
        """Return the paths of the programs that are installed as they are."""
        scripts = self._value(self._setup_arguments.get("scripts"))
        return [path for path in scripts if isinstance(path, str)] if isinstance(scripts, list) else []

    def package_root(self) -> str:
        """Return the folder of the modules, from the folder of the package."""
        package_dir = self._value(self._setup_arguments.get("package_dir"))
        root = package_dir.get("", "") if isinstance(package_dir, dict) else ""
        return root if isinstance(root, str) else ""

    def _value(self, node: ast.expr | None, depth: int = 20) -> object:
        """Return the value of an expression; None if it would have to be run."""
        literal: object = None
        if depth == 0 or node is None:
            return literal
        match node:
            case ast.Constant(value=value):
                literal = value
            case ast.Name(id=name) if name in self._names:
                literal = self._value(self._names[name], depth - 1)
            case ast.List(elts=parts) | ast.Tuple(elts=parts):
                literal = [self._value(part, depth - 1) for part in parts]
            case ast.Dict(keys=keys, values=values):
                pairs = zip(keys, values, strict=True)
                literal = {str(self._value(key, depth - 1)): self._value(value, depth - 1) for key, value in pairs}
            case ast.JoinedStr(values=parts):
                literal = self._joined([self._value(part, depth - 1) for part in parts])
            case ast.FormattedValue(value=inner, conversion=-1, format_spec=None):
                literal = self._value(inner, depth - 1)
            case ast.BinOp(left=left, op=ast.Add(), right=right):
                literal = self._joined([self._value(left, depth - 1), self._value(right, depth - 1)])
            case _:
                self.is_computed = True
        return literal

    def _joined(self, parts: list[object]) -> object:
        if all(isinstance(part, str) for part in parts):
            return "".join(map(str, parts))
        if all(isinstance(part, list) for part in parts):
            return [entry for part in parts if isinstance(part, list) for entry in part]
        self.is_computed = True
        return None


def workspace_of(stated: str | None, workspace: Workspace) -> Path:
    """Return the ROS 2 workspace of a scenario.

    It is the folder `stated`: a workspace, an install folder or prefix, or any folder with packages. Otherwise it is
    the nearest folder around the scenario with an install folder or with packages in its `src`, else the root.
    Raise PathError.
    """
    return workspace_folder(
        stated, workspace, lambda folder: _is_install(folder / INSTALL) or bool(packages_below(folder / "src"))
    )


@dataclass(frozen=True, slots=True)
class Packages:
    """The packages of a workspace and of ROS 2; `ros` None: ROS 2 is not installed, and may have other packages.

    `installed`, `distributed`: name -> prefix of built packages, and of ROS 2's. `sources`: the other packages.
    `outdated`: Python files of packages that are built, and whose installed copies differ.
    """

    workspace: Path
    installed: Mapping[str, Path]
    sources: Mapping[str, PythonPackage]
    ros: Ros2 | None
    distributed: Mapping[str, Path]
    outdated: tuple[Path, ...] = ()

    @classmethod
    def around(cls, workspace: Path, ros: Ros2 | None) -> Packages:
        """Return the packages of a workspace and of an installation."""
        prefixes = prefixes_in(workspace)
        installed = _by_name(prefixes)
        folders = _source_folders(workspace)
        sources = {name: read_package(name, folder) for name, folder in folders.items() if name not in installed}
        both = (name for name in folders if name in installed)
        outdated = tuple(path for name in both for path in _outdated(name, folders[name], installed[name]))
        return cls(workspace, installed, sources, ros, _by_name(ros.prefixes) if ros else {}, outdated)

    @property
    def notes(self) -> list[str]:
        """Notes for the user: files that were changed after the build."""
        if not self.outdated:
            return []
        first = ", ".join(str(path.name) for path in self.outdated[:3])
        count = counted(len(self.outdated), "file")
        return [f"not built again: {count} ({first}) differ from the copies in '{INSTALL}', which run; {BUILD}"]

    @property
    def names(self) -> set[str]:
        """The names of the user's packages, or of all packages if the user has none."""
        return {*self.installed, *self.sources} or set(self.distributed)

    def prefix(self, name: str) -> Path | None:
        """Return the prefix where a package is installed; None: it is not."""
        return self.installed.get(name) or self.distributed.get(name)

    def executables(self, name: str) -> dict[str, Path | None]:
        """Return all programs of a package; None: it is an entry point of a package in source."""
        source = self.sources.get(name)
        if source is not None:
            return {**dict.fromkeys(source.entry_points), **{path.name: path for path in source.scripts}}
        prefix = self.prefix(name)
        return {path.name: path for path in _files(prefix / "lib" / name)} if prefix else {}

    def launch_files(self, name: str) -> dict[str, Path]:
        """Return the launch files of a package by their names."""
        source = self.sources.get(name)
        prefix = self.prefix(name)
        share = source.folder if source else prefix and prefix / "share" / name
        if share is None:
            return {}
        files = (path for path in _files(share) if path.suffix in _LAUNCH_SUFFIXES)
        return {path.name: path for path in files if "launch" in path.name or path.parent.name == "launch"}

    def set_up(self, folder: Path) -> dict[str, str]:
        """Return the variables of all processes, and write the overlay into an empty folder. Needs an installation."""
        assert self.ros is not None
        overlay = folder / _OVERLAY
        python = [package for package in self.sources.values() if package.is_python]
        for package in python:
            _install(package, overlay, self.ros.python)
        before = {**os.environ, **self.ros.variables}
        prefixes = (*([overlay] if python else []), *dict.fromkeys(self.installed.values()))
        variables = {**self.ros.variables, **set_up(prefixes, before).variables}
        modules = [str(package.modules) for package in python]
        paths = [path for path in variables.get("PYTHONPATH", "").split(os.pathsep) if path]
        return {**variables, "PYTHONPATH": os.pathsep.join(dict.fromkeys([*modules, *paths]))}

    def command(self, package: str, executable: str, folder: Path) -> list[str]:
        """Return the command of a program; `folder`: the one of `set_up`. Raise PathError if it does not exist."""
        assert self.ros is not None
        path = self.executables(package).get(executable, Path())
        if path is None:
            return [str(self.ros.python), str(folder / _OVERLAY / "lib" / package / executable)]
        if not path.is_file():
            raise PathError(f"the executable '{package}/{executable}' does not exist any more")
        return command_of(path, self.ros.python)

    def program(self, package: str, executable: str) -> Path | None:
        """Return the file of a program in Python of a package in source; None: it has no such program."""
        source = self.sources.get(package)
        if source is None or (entry := source.entry_points.get(executable)) is None:
            return self.executables(package).get(executable) if source else None
        path = source.modules.joinpath(*entry.partition(":")[0].split("."))
        return next((file for file in (path.with_suffix(".py"), path / "__init__.py") if file.is_file()), None)

    def missing_modules(self, program: Path) -> list[str]:
        """Return modules that a program always imports, and that it does not find. Needs an installation."""
        assert self.ros is not None
        stated = [path for path in (self.ros.variables.get("PYTHONPATH") or "").split(os.pathsep) if path]
        own = (self.ros.python.parent.parent, Path("/usr"), Path("/usr/local"), Path.home() / ".local")
        folders = [program.parent, *map(Path, stated), *(package.modules for package in self.sources.values())]
        for root in (*self.ros.prefixes, *self.installed.values(), *own):
            folders += root.glob("lib/python3*/*-packages")
        hooks = [_content(path) for folder in folders for path in folder.glob("*.pth")]
        if any(hook.lstrip().startswith(b"/") for hook in hooks):
            return []  # other folders, as editable installations have them
        names = dict.fromkeys(name.partition(".")[0] for name in imported(program))
        return [name for name in names if name not in sys.stdlib_module_names and not _has_module(folders, name)]


def imported(program: Path) -> Iterator[str]:
    """Yield the modules that a program in Python imports first of all."""
    for node in _syntax(program).body:
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module


def _has_module(folders: Iterable[Path], name: str) -> bool:
    return any((folder / name).is_dir() or any(folder.glob(f"{name}.*")) for folder in folders)


def command_of(program: Path, python: Path) -> list[str]:
    """Return the command that runs a program: programs in Python are run by the Python of ROS 2."""
    return [str(python), str(program)] if is_python(program) else [str(program)]


def is_python(program: Path) -> bool:
    """Return True for a program in Python: by its suffix, or the interpreter of its first line."""
    if program.suffix == ".py":
        return True
    try:
        with program.open("rb") as file:
            first = file.readline(_MAX_FIRST_LINE_BYTES)
    except OSError:
        return False
    return first.startswith(b"#!") and any(word.rpartition(b"/")[2].startswith(b"python") for word in first.split())


def prefixes_in(folder: Path) -> tuple[Path, ...]:
    """Return the install prefixes of a workspace: its install folder, or one for each package in it."""
    install = folder if _is_install(folder) else folder / INSTALL
    if not _is_install(install):
        return ()
    isolated = [path for path in _folders(install) if (path / "share" / path.name / PACKAGE_FILE).is_file()]
    merged = [install] if packages_of_prefix(install) else []
    return (*merged, *isolated)


def _is_install(folder: Path) -> bool:
    return (folder / _LAYOUT_FILE).is_file() or (folder / _INDEX).is_dir()


def _source_folders(workspace: Path) -> dict[str, Path]:
    """Return name -> folder of the packages in source; next to an install folder, they are in `src`."""
    if _is_install(workspace):
        return packages_below(workspace.parent / "src")
    return packages_below(source_folder(workspace))


def packages_below(folder: Path) -> dict[str, Path]:
    """Return name -> folder of the packages in a folder and below it. Raise PathError for two with the same name."""
    packages = folders_below(folder, inside_packages=False).packages
    for name, folders in packages.items():
        if len(folders) > 1:
            places = " and ".join(map(str, folders[:3]))
            raise PathError(f"there are {len(folders)} packages '{name}': {places}; remove or rename one")
    return {name: folders[0] for name, folders in packages.items()}


def _by_name(prefixes: Sequence[Path]) -> dict[str, Path]:
    packages: dict[str, Path] = {}
    for prefix in prefixes:
        for name in packages_of_prefix(prefix):
            packages.setdefault(name, prefix)
    return packages


def _outdated(name: str, folder: Path, prefix: Path) -> Iterator[Path]:
    """Yield the Python files in the source of a package whose installed copies differ; links never do."""
    places = (prefix / "lib" / name, prefix / "share" / name, *prefix.glob(f"lib/python3*/*-packages/{name}"))
    copies = {path.name: path for place in places for path in place.rglob("*.py") if path.is_file()}
    for path in sorted(folder.rglob("*.py")):
        copy = copies.get(path.name)
        if copy is not None and _is_in(path, folder) and _content(path) != content_or_empty(copy, _MAX_FILE_BYTES):
            yield path


def _install(package: PythonPackage, prefix: Path, python: Path) -> None:
    """Write what `colcon build --symlink-install` would install of a package, except its modules."""
    programs, share, index = prefix / "lib" / package.name, prefix / "share", prefix / _INDEX
    for folder in (programs, share, index):
        folder.mkdir(parents=True, exist_ok=True)
    (index / package.name).touch()
    (share / package.name).symlink_to(package.folder)
    for name, entry in package.entry_points.items():
        module, _, function = entry.partition(":")
        first = function.partition(".")[0]
        text = (
            f"import sys\n\nfrom {module} import {first}\n\nsys.exit({function}())\n" if first else f"import {module}\n"
        )
        path = programs / name
        # A first line with the path of Python would be limited in length and could have no blanks.
        path.write_text(f"#!/bin/sh\n'''exec' \"{python}\" \"$0\" \"$@\"\n' '''\n{text}", encoding="utf-8")
        path.chmod(0o755)
    for script in package.scripts:
        (programs / script.name).symlink_to(script)


def _folders(folder: Path) -> list[Path]:
    try:
        return sorted(path for path in folder.iterdir() if path.is_dir())
    except OSError:
        return []


def _files(folder: Path) -> Iterator[Path]:
    return (path for path in sorted(folder.rglob("*")) if path.is_file() and "__pycache__" not in path.parts)
