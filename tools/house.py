"""Measure the size and the order of the house, print a table with its limits, and exit with 1 if a limit is broken.

    python -m tools.house [-v]

`-v` lists the places that count. `LIMITS` is the only list of the limits; `make lint` keeps them.
"""

from __future__ import annotations

import argparse
import ast
import re
import subprocess
import sys
import tomllib
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final, TypeVar

Node = TypeVar("Node", bound=ast.AST)

ROOT: Final = Path(__file__).resolve().parents[1]
PACKAGE: Final = "sim_action"

LIMITS: Final[Mapping[str, int]] = {
    "lines of sim_action": 112_000,
    "modules of sim_action": 540,
    "lines of tests above those of sim_action": 0,
    "modules with a single importer": 120,
    "circles of modules": 0,
    "modules that import themselves": 0,
    "imports that run upward": 0,
    "comparisons of a part's key outside the part": 0,
    "lists of engine names outside ENGINES": 0,
    "places that rank exit codes": 1,
    "entries at the root": 28,
    "imports inside functions without a reason": 0,
    "repeated names of modules": 0,
}
# Imported inside functions: each takes tens of milliseconds, or is missing on some systems.
HEAVY: Final = frozenset(
    {
        *("av", "importlib", "mcap", "mujoco", "numpy", "onnxruntime", "PIL", "pydantic", "rosbags", "xacro", "yaml"),
        *("launch_ros", "launch_testing", "rcl_interfaces", "rclpy", "rospy"),
        *("fcntl", "msvcrt", "resource"),
    }
)
# Folder or module -> why its functions import other modules of the package.
LAZY: Final[Mapping[str, str]] = {
    "sim_action.cli": "a command imports what it runs: `--help` and `validate` start without the rest",
    "sim_action.__main__": "likewise",
}
_PART_ROOMS: Final = tuple(f"{PACKAGE}.{room}" for room in ("assertions", "commands", "drives", "sensors"))
_CODES: Final = re.compile(r"(?:exit_?)?codes?|ExitCode", re.IGNORECASE)


@dataclass(frozen=True)
class Import:
    """An import of a module of the package.

    Attributes:
        importer, imported: names of modules.
        is_lazy: it stands in a function.
        has_reason: a comment on its line or the line above it gives one.
    """

    importer: str
    imported: str
    line: int
    is_lazy: bool
    has_reason: bool


@dataclass(frozen=True)
class Row:
    """A line of the table; `places`: what counts, for `-v`."""

    name: str
    value: int
    places: tuple[str, ...] = ()

    @property
    def limit(self) -> int:
        """The largest value that is allowed."""
        return LIMITS[self.name]

    @property
    def holds(self) -> bool:
        """True if the value is within its limit."""
        return self.value <= self.limit


class House:
    """The repository below a folder, as source text.

    :param layers: the layers of the package from the highest to the lowest; `|` separates rooms of the same layer.
    """

    def __init__(self, root: Path = ROOT, layers: Iterable[str] | None = None) -> None:
        self.root = root
        self._layers = _configured_layers(root) if layers is None else list(layers)

    @cached_property
    def sources(self) -> dict[str, str]:
        """Module -> its text."""
        paths = sorted((self.root / PACKAGE).rglob("*.py"))
        return {self._module(path): path.read_text(encoding="utf-8") for path in paths}

    @cached_property
    def _lines(self) -> dict[str, list[str]]:
        return {module: text.splitlines() for module, text in self.sources.items()}

    @cached_property
    def nodes(self) -> dict[str, list[ast.AST]]:
        """Module -> all nodes of its syntax tree."""
        return {module: list(ast.walk(ast.parse(text))) for module, text in self.sources.items()}

    @cached_property
    def packages(self) -> frozenset[str]:
        """The modules that are folders."""
        return frozenset(self._module(path) for path in (self.root / PACKAGE).rglob("__init__.py"))

    @cached_property
    def imports(self) -> list[Import]:
        """The imports of modules of the package, each name on its own."""
        return [one for module in self.nodes for one in self._imports_of(module)]

    @cached_property
    def graph(self) -> dict[str, set[str]]:
        """Module -> the modules that it imports, also inside functions; not those for a type checker alone."""
        graph: dict[str, set[str]] = {module: set() for module in self.sources}
        for one in self.imports:
            if one.importer != one.imported:
                graph[one.importer].add(one.imported)
        return graph

    def single_importers(self) -> Iterator[str]:
        """Yield the modules, without folders, that one other module imports."""
        importers = defaultdict(set)
        for importer, imported in self.graph.items():
            for module in imported:
                importers[module].add(importer)
        for module, names in sorted(importers.items()):
            if len(names) == 1 and module not in self.packages:
                yield f"{module} ({self.sources[module].count(chr(10))} lines) <- {next(iter(names))}"

    def circles(self) -> Iterator[str]:
        """Yield each set of modules that import one another."""
        for circle in _strong_components(self.graph):
            if len(circle) > 1:
                yield ", ".join(sorted(circle))

    def self_imports(self) -> Iterator[str]:
        """Yield the modules that import themselves, as a fold may leave them inside functions."""
        yield from sorted({one.importer for one in self.imports if one.importer == one.imported})

    def upward_imports(self) -> Iterator[str]:
        """Yield the imports of a higher layer, and of the package's root from inside the package."""
        rank = {room: height for height, layer in enumerate(self._layers) for room in re.findall(r"\w+", layer)}
        for one in self.imports:
            importer, imported = (rank.get(name.split(".")[1]) if "." in name else -1 for name in _ends(one))
            if importer is not None and imported is not None and importer > imported:
                yield f"{one.importer}:{one.line} imports {one.imported}"

    def key_comparisons(self) -> Iterator[str]:
        """Yield the comparisons of an attribute `key` with constants, outside the rooms of parts."""
        for module, node in self._nodes(ast.Compare):
            sides = [node.left, *node.comparators]
            has_key = any(isinstance(side, ast.Attribute) and side.attr == "key" for side in sides)
            if has_key and any(map(_is_constant, sides)) and not module.startswith(_PART_ROOMS):
                yield f"{module}:{node.lineno} {ast.unparse(node)}"

    def engine_lists(self) -> Iterator[str]:
        """Yield the literals that name both engines, outside the module of the table."""
        for module, node in self._nodes(ast.List, ast.Tuple, ast.Set, ast.Dict):
            names = {part.value for part in ast.iter_child_nodes(node) if isinstance(part, ast.Constant)}
            if {"mujoco", "pybullet"} <= names and module != f"{PACKAGE}.engines":
                yield f"{module}:{node.lineno}"

    def exit_code_ranks(self) -> Iterator[str]:
        """Yield the calls of max and min about exit codes."""
        for module, node in self._nodes(ast.Call):
            if not (isinstance(node.func, ast.Name) and node.func.id in {"max", "min"}):
                continue
            names = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
            names |= {part.attr for part in ast.walk(node) if isinstance(part, ast.Attribute)}
            if any(map(_CODES.fullmatch, names)):
                yield f"{module}:{node.lineno} {ast.unparse(node)}"

    def lazy_imports(self) -> Iterator[str]:
        """Yield the imports inside functions that neither HEAVY, LAZY nor a comment next to them explains."""
        allowed = {module for module in self.nodes if any(f"{module}.".startswith(f"{room}.") for room in LAZY)}
        for one in self.imports:
            if one.is_lazy and not one.has_reason and one.importer not in allowed:
                yield f"{one.importer}:{one.line} imports {one.imported}"
        for module, nodes in self.nodes.items():
            for node in _in_functions(nodes):
                names = [node.module or ""] if isinstance(node, ast.ImportFrom) else [name.name for name in node.names]
                tops = {name.split(".")[0] for name in names} - HEAVY - {PACKAGE}
                if tops and module not in allowed and not self._has_reason(module, node.lineno):
                    yield f"{module}:{node.lineno} imports {', '.join(sorted(tops))}"

    def repeated_names(self) -> Iterator[str]:
        """Yield the names that four or more modules have, in different folders; every engine has an `engine`."""
        names = Counter(module.rpartition(".")[2] for module in self.sources if module not in self.packages)
        for name, count in names.items():
            if count > 3 and name != "engine":
                yield f"{name} ({count} times)"

    def root_entries(self) -> Iterator[str]:
        """Yield the names of tracked files and folders at the root."""
        listed = subprocess.run(["git", "ls-files"], cwd=self.root, check=True, capture_output=True, text=True)
        yield from sorted({line.partition("/")[0] for line in listed.stdout.splitlines()})

    def rows(self) -> list[Row]:
        """Return the table."""
        lines = sum(text.count("\n") for text in self.sources.values())
        tests = sum(path.read_text(encoding="utf-8").count("\n") for path in (self.root / "tests").rglob("*.py"))
        places: dict[str, Callable[[], Iterator[str]]] = {
            "modules with a single importer": self.single_importers,
            "circles of modules": self.circles,
            "modules that import themselves": self.self_imports,
            "imports that run upward": self.upward_imports,
            "comparisons of a part's key outside the part": self.key_comparisons,
            "lists of engine names outside ENGINES": self.engine_lists,
            "places that rank exit codes": self.exit_code_ranks,
            "entries at the root": self.root_entries,
            "imports inside functions without a reason": self.lazy_imports,
            "repeated names of modules": self.repeated_names,
        }
        counts = {
            "lines of sim_action": lines,
            "modules of sim_action": len(self.sources),
            "lines of tests above those of sim_action": tests - lines,
        }
        matches = {name: tuple(search()) for name, search in places.items()}
        return [
            *(Row(name, value) for name, value in counts.items()),
            *(Row(name, len(rows), rows) for name, rows in matches.items()),
        ]

    def _module(self, path: Path) -> str:
        return ".".join(path.relative_to(self.root).with_suffix("").parts).removesuffix(".__init__")

    def _imports_of(self, module: str) -> Iterator[Import]:
        nodes = self.nodes[module]
        lazy = set(_in_functions(nodes))
        for_types = set(_for_type_checkers(nodes))
        for node in nodes:
            if isinstance(node, ast.Import | ast.ImportFrom) and node not in for_types:
                for imported in sorted(self._imported(module, node)):
                    yield Import(module, imported, node.lineno, node in lazy, self._has_reason(module, node.lineno))

    def _imported(self, module: str, node: ast.Import | ast.ImportFrom) -> set[str]:
        if isinstance(node, ast.Import):
            names = {name.name for name in node.names}
        else:
            base = node.module or ""
            if node.level:
                package = module if module in self.packages else module.rpartition(".")[0]
                parts = package.split(".")
                base = ".".join([*parts[: len(parts) - node.level + 1], *filter(None, [base])])
            names = {full if (full := f"{base}.{name.name}") in self.sources else base for name in node.names}
        return names & self.sources.keys()

    def _has_reason(self, module: str, line: int) -> bool:
        lines = self._lines[module]
        return re.search(r"#(?! noqa: \S+$)", lines[line - 1]) is not None or lines[line - 2].lstrip().startswith("#")

    def _nodes(self, *kinds: type[Node]) -> Iterator[tuple[str, Node]]:
        for module, nodes in self.nodes.items():
            for node in nodes:
                if isinstance(node, kinds):
                    yield module, node


def _ends(one: Import) -> tuple[str, str]:
    return one.importer, one.imported


def _is_constant(node: ast.expr) -> bool:
    """Return True for a text, several texts, or the name of a constant."""
    match node:
        case ast.Constant(value=str()):
            return True
        case ast.Tuple(elts=elements) | ast.List(elts=elements) | ast.Set(elts=elements):
            return all(map(_is_constant, elements))
        case ast.Name(id=name):
            return name.lstrip("_").isupper()
    return False


def _configured_layers(root: Path) -> list[str]:
    settings = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    [layers] = [contract["layers"] for contract in settings["contracts"] if contract.get("containers") == [PACKAGE]]
    return list(layers)


def _in_functions(nodes: Iterable[ast.AST]) -> Iterator[ast.Import | ast.ImportFrom]:
    """Yield the imports inside functions, each once."""
    functions = (node for node in nodes if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef))
    inside = (node for function in functions for node in ast.walk(function))
    yield from dict.fromkeys(node for node in inside if isinstance(node, ast.Import | ast.ImportFrom))


def _for_type_checkers(nodes: Iterable[ast.AST]) -> Iterator[ast.AST]:
    """Yield what stands below `if TYPE_CHECKING`."""
    for node in nodes:
        match node:
            case ast.If(test=ast.Name(id="TYPE_CHECKING") | ast.Attribute(attr="TYPE_CHECKING"), body=body):
                for statement in body:
                    yield from ast.walk(statement)


def _strong_components(graph: Mapping[str, set[str]]) -> Iterator[list[str]]:
    """Yield the strongly connected components of a graph (Tarjan 1972)."""
    order: dict[str, int] = {}
    lowest: dict[str, int] = {}
    stack: list[str] = []

    def visit(node: str) -> Iterator[list[str]]:
        order[node] = lowest[node] = len(order)
        stack.append(node)
        for following in sorted(graph[node]):
            if following not in order:
                yield from visit(following)
                lowest[node] = min(lowest[node], lowest[following])
            elif following in stack:
                lowest[node] = min(lowest[node], order[following])
        if lowest[node] == order[node]:
            start = stack.index(node)
            component = stack[start:]
            del stack[start:]
            yield component

    for node in graph:
        if node not in order:
            yield from visit(node)


def table(rows: Iterable[Row], *, verbose: bool = False) -> str:
    """Return the rows as text; a broken limit is marked."""
    lines = list[str]()
    for row in rows:
        mark = " " if row.holds else "!"
        lines.append(f"{mark} {row.name:<46} {row.value:>8,} of {row.limit:>8,}")
        if verbose:
            lines += [f"      {place}" for place in row.places]
    return "\n".join(lines)


def main() -> int:
    """Print the table and return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tools.house", description="Measure the size of the house.")
    parser.add_argument("-v", "--verbose", action="store_true", help="list the places that count")
    options = parser.parse_args()
    rows = House().rows()
    print(table(rows, verbose=options.verbose))
    return 0 if all(row.holds for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
