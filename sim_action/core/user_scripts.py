"""Python files of the user: read as text to check a scenario, executed only in the child process of the scenario."""

from __future__ import annotations

import ast
import itertools
import linecache
import re
import sys
import traceback
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, Final

from sim_action.core.errors import Location, ScriptError
from sim_action.core.files import read_at_most
from sim_action.core.records import dataclass
from sim_action.core.wording import as_text, did_you_mean, excerpt, first_of

ANYTHING: Final = "*"  # a name in `Script.names`: the script imports all names of another module
_MAX_SCRIPT_BYTES: Final = 1_000_000
_MAX_CACHED: Final = 16
# In a traceback: a recursion has a thousand frames.
_MAX_FRAMES: Final = 10
_LINES_AROUND: Final = 2
_MODULES: Final = (
    "scripts run in sim-action's own Python, which has numpy and can import files from their folder; "
    "a controller that needs other packages runs as a 'process', with your own Python"
)
_OURS: Final = str(Path(__file__).parent.parent / "_").removesuffix("_")


_SHARED: Final = frozenset(
    {"builtins", "hashlib", "io", "json", "math", "numpy", "os", "sim_action", "struct", "tempfile", "time", "zipfile"}
    | {"zlib"}
)
"""The modules, with all below them, that user code shares with sim-action in its process."""
_MAX_REPLACED_SHOWN: Final = 5


class SharedModules:
    """The content of the shared modules before user code runs, which can replace what sim-action calls next."""

    def __init__(self, engines: Iterable[str] = ()) -> None:
        """Note what the modules hold now; `engines`: the packages of the engines, which count too."""
        shared = _SHARED.union(engines)
        self._before = {
            name: (module, dict(vars(module)))
            for name, module in list(sys.modules.items())
            if name.partition(".")[0] in shared and isinstance(module, ModuleType)
        }

    def replaced(self) -> list[str]:
        """Return the names of the functions, classes and modules that were replaced or removed since."""
        gone = [name for name, (module, _) in self._before.items() if sys.modules.get(name) is not module]
        return gone + [
            f"{name}.{key}"
            for name, (module, before) in self._before.items()
            for key, value in before.items()
            if (callable(value) or type(value) is type(sys)) and vars(module).get(key) is not value
        ]

    def fault(self, error: Exception) -> ScriptError | None:
        """Return an exception of sim-action as the error of the code that replaced what it needs; None: nothing was."""
        names = self.replaced()
        if not names:
            return None
        replaced = first_of(names, _MAX_REPLACED_SHOWN)
        return ScriptError(
            f"code of this scenario replaced {replaced}, which sim-action uses in the same process, and then the run "
            f"broke ({type(error).__name__}: {error}); change a copy, or run the code as a 'process'"
        )


class ScriptProblem(ValueError):
    """The reason why a file cannot be used as a script; it follows the name of the file in messages."""


@dataclass(frozen=True, slots=True)
class Parameters:
    """The parameters of a function after its first, or of the `__init__` of a class after `self`."""

    line: int  # of the `def`, or of the class if it has no `__init__`
    names: tuple[str, ...] = ()  # parameters that can be given by name
    required: tuple[str, ...] = ()  # parameters without a default
    takes_others: bool = False  # True if it has `**others`

    def problems(self, arguments: Collection[str]) -> Iterator[tuple[str | None, str]]:
        """Yield each given name that does not exist, and None with each required name that is not given."""
        for name in [] if self.takes_others else [name for name in arguments if name not in self.names]:
            yield name, f"has no parameter '{name}'{did_you_mean(name, self.names)}"
        for name in [name for name in self.required if name not in arguments]:
            yield None, f"requires '{name}'"


@dataclass(frozen=True, slots=True)
class ScriptClass:
    """A class of a script, as far as its text shows."""

    name: str
    line: int
    names: frozenset[str]
    is_plain: bool  # True if it has no bases and no decorators
    parameters: Parameters | None  # of its `__init__`; None: the text does not show them


@dataclass(frozen=True, slots=True)
class Script:
    """The content of a Python file, as far as its text shows."""

    names: frozenset[str]  # all names that it defines, imports or assigns at module level, also in an `if` or a `try`
    # name -> parameters of each function that it defines at module level; None: the text does not show them
    functions: Mapping[str, Parameters | None]
    classes: tuple[ScriptClass, ...]  # the classes that it defines at module level

    def class_named(self, name: str) -> ScriptClass | None:
        """Return a class; None: the text does not show it."""
        return next((script_class for script_class in self.classes if script_class.name == name), None)


def read_script(path: Path) -> Script:
    """Read a Python file without running it. Raise OSError, ScriptProblem."""
    if (source := read_at_most(path, _MAX_SCRIPT_BYTES)) is None:
        raise ScriptProblem(f": the script is larger than {_MAX_SCRIPT_BYTES // 1000} kB, the maximum")
    script = _parsed(source)
    if isinstance(script, str):
        raise ScriptProblem(script)
    return script


# Parsing a large file takes seconds, and many expectations may use classes of the same file.
@lru_cache(maxsize=_MAX_CACHED)
def _parsed(source: bytes) -> Script | str:
    """Return the names that a source text defines, or the reason why it is not valid Python."""
    try:
        tree = ast.parse(source)
    except SyntaxError as error:
        line = "" if error.lineno is None else f":{error.lineno}"
        return f"{line}: not valid Python: {error.msg}"
    except (ValueError, RecursionError, MemoryError) as error:
        return f": not valid Python: {error}"
    bound = _bindings(tree.body)
    nodes = [node for node in tree.body if isinstance(node, ast.ClassDef | ast.FunctionDef)]
    # A name that is bound again may be a decorated function, or a class with another __init__.
    shown = {node.name: bound.count(node.name) == 1 for node in nodes}
    defined = [node for node in nodes if isinstance(node, ast.FunctionDef)]
    functions = {node.name: _parameters(node) if shown[node.name] else None for node in defined}
    classes = (_class_of(node, shown=shown[node.name]) for node in nodes if isinstance(node, ast.ClassDef))
    return Script(frozenset(bound), functions, tuple(classes))


def _class_of(node: ast.ClassDef, *, shown: bool) -> ScriptClass:
    is_plain = not (node.bases or node.keywords or node.decorator_list)
    names = frozenset(_bindings(node.body))
    return ScriptClass(node.name, node.lineno, names, is_plain, _parameters_of_class(node, names) if shown else None)


def _parameters_of_class(node: ast.ClassDef, names: frozenset[str]) -> Parameters | None:
    """Return the parameters of `__init__`; None if a base, a decorator or other code decides them."""
    inits = [
        statement for statement in node.body if isinstance(statement, ast.FunctionDef) and statement.name == "__init__"
    ]
    if node.bases or node.keywords or "__new__" in names or len(inits) != ("__init__" in names):
        return None
    decorators = list(map(_called, node.decorator_list))
    if decorators not in ([], ["dataclass"]):
        return None
    if inits:
        return _parameters(inits[0])
    return _parameters_of_dataclass(node) if decorators else Parameters(node.lineno)


def _parameters(node: ast.FunctionDef) -> Parameters | None:
    """Return the parameters of a function without its first; None if a decorator may change them."""
    if node.decorator_list:
        return None
    arguments = node.args
    plain = [*arguments.posonlyargs, *arguments.args]
    by_name = plain[max(1, len(arguments.posonlyargs)) :] + arguments.kwonlyargs
    required = plain[1 : len(plain) - len(arguments.defaults)]
    pairs = zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True)
    required += [argument for argument, default in pairs if default is None]
    names, needed = (tuple(argument.arg for argument in group) for group in (by_name, required))
    return Parameters(node.lineno, names, needed, arguments.kwarg is not None)


def _parameters_of_dataclass(node: ast.ClassDef) -> Parameters | None:
    if any(isinstance(decorator, ast.Call) and "init" in _keywords(decorator) for decorator in node.decorator_list):
        return None
    names, required = [], []
    for statement in node.body:
        match statement:
            case ast.AnnAssign(target=ast.Name(id=name), annotation=annotation, value=value):
                if not {"ClassVar", "KW_ONLY"}.isdisjoint(_words(annotation)):
                    continue
                is_field = isinstance(value, ast.Call) and _called(value) == "field"
                keywords = _keywords(value) if isinstance(value, ast.Call) and is_field else {"default"}
                if "init" in keywords:
                    return None
                names.append(name)
                if value is None or keywords.isdisjoint(("default", "default_factory")):
                    required.append(name)
    return Parameters(node.lineno, tuple(names), tuple(required))


def _called(node: ast.expr) -> str:
    """Return the last part of a name such as `dataclasses.dataclass`, which may be called; "" for other code."""
    match node.func if isinstance(node, ast.Call) else node:
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return name
        case _:
            return ""


def _keywords(call: ast.Call) -> set[str | None]:
    return {keyword.arg for keyword in call.keywords}


def _words(annotation: ast.expr) -> set[str]:
    """Return the names in an annotation, also in one that is written as a text."""
    words = set[str]()
    for node in ast.walk(annotation):
        match node:
            case ast.Name(id=name) | ast.Attribute(attr=name):
                words.add(name)
            case ast.Constant(value=str(text)):
                words.update(re.findall(r"\w+", text))
    return words


def _bindings(body: Sequence[ast.AST]) -> list[str]:
    """Return the names that statements bind, each as often as it is bound."""
    names = []
    waiting = list(body)
    while waiting:
        match node := waiting.pop():
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                names.append(name)
                continue
            case ast.alias():
                names.append(node.asname or node.name)
            case ast.Name(ctx=ast.Store()):
                names.append(node.id)
        waiting += ast.iter_child_nodes(node)
    return names


def run_file(path: Path, who: str) -> Mapping[str, Any]:
    """Run a file as a module, which may import files from its folder, and return its names. Raise ScriptError."""
    sys.path.insert(0, str(path.parent))
    stem = path.stem.replace(".", "_")
    names = itertools.chain((stem,), (f"{stem}_{number}" for number in itertools.count(2)))
    name = next(name for name in names if name not in sys.modules and name not in sys.stdlib_module_names)
    spec = spec_from_loader(name, _FromSource(name, str(path)))
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[name] = module_from_spec(spec)
    try:
        with script_errors_at(path, who):
            spec.loader.exec_module(module)
    except ScriptError:
        sys.modules.pop(name, None)
        raise
    return vars(module)


class _FromSource(SourceFileLoader):
    """A loader that ignores bytecode, which may be outdated, and writes none to the user's folder."""

    def get_code(self, fullname: str) -> CodeType:
        path = self.get_filename(fullname)
        return self.source_to_code(self.get_data(path), path)


@contextmanager
def script_errors_at(path: Path, who: str) -> Iterator[None]:
    """Raise ScriptError with the line for all exceptions of user code, SystemExit included."""
    try:
        yield
    except BaseException as error:  # noqa: BLE001 - sys.exit() in a script must not end the run unseen
        raise script_error(error, path, who) from None


def script_error(error: BaseException, path: Path, who: str) -> ScriptError:
    """Return an error with the place in the user's file; frames of sim-action are left out; `who` raised it."""
    if isinstance(error, SyntaxError) and error.filename:
        place = Location(error.filename, error.lineno)
        return ScriptError(f"SyntaxError: {error.msg}", place, _lines_around(place))
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if not _is_machinery(frame.filename)]
    lines = [frame.lineno for frame in frames if frame.filename == str(path)]
    what = traceback.format_exception_only(error)[-1].strip()
    if isinstance(error, ModuleNotFoundError):
        what += f"; {_MODULES}"
    place = Location(str(path), lines[-1] if lines else None)
    # After a MemoryError, as little memory as possible is used.
    if isinstance(error, MemoryError):
        return ScriptError(f"{who} raised {what}", place)
    details = "\n\n".join(filter(None, (_traceback(frames, path.parent), _lines_around(place))))
    return ScriptError(f"{who} raised {what}", place, details)


def _lines_around(place: Location) -> str:
    """Return five lines of a file about a place; empty if it cannot be read."""
    lines = linecache.getlines(place.file) if place.line is not None else []
    shown = excerpt(lines, {place.line} if place.line is not None else (), _LINES_AROUND)
    return f"{Path(place.file).name}:{place.line}\n{as_text(shown)}" if shown else ""


def _is_machinery(file: str) -> bool:
    return file.startswith((_OURS, "<frozen "))


def _traceback(frames: list[traceback.FrameSummary], folder: Path) -> str:
    """Return the last frames as Python shows them, with files relative to a folder; "" for a single frame."""
    if len(frames) < 2:
        return ""
    seen = [
        traceback.FrameSummary(_seen_from(folder, frame.filename), frame.lineno, frame.name, line=frame.line)
        for frame in frames[-_MAX_FRAMES:]
    ]
    return "".join(("Traceback (most recent call last):\n", *traceback.StackSummary.from_list(seen).format())).rstrip()


def _seen_from(folder: Path, file: str) -> str:
    return Path(file).relative_to(folder).as_posix() if Path(file).is_relative_to(folder) else file
