"""The table of the parts of launch files, for a ROS 2 without `launch`: one for Python, XML and YAML.

A row is a function; its parameters are the words that the part accepts, under the names of `launch` and `launch_ros`.
Nothing is refused before it runs: a group whose condition is false may have parts that only `launch` has.
"""

from __future__ import annotations

import inspect
import json
import os
import sys
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from ament_index_python.packages import get_packages_with_prefixes

# The words of processes that change nothing in a simulation, or only how a process is shown and ended.
_WITHOUT_EFFECT = frozenset(
    {
        *("output", "output_format", "emulate_tty", "log_cmd", "cached_output", "sigterm_timeout", "sigkill_timeout"),
        *("respawn_delay", "respawn_max_retries"),
    }
)


class LaunchError(Exception):
    """A launch file that cannot be run; `event`: what the event "refused" has, `places`: (file, line) from outside."""

    def __init__(self, kind: str, message: str = "", **more: Any) -> None:
        super().__init__(message)
        self.event = {"kind": kind, "message": message, **more}
        self.places: list[tuple[str, int]] = []

    @classmethod
    def of(cls, error: BaseException) -> LaunchError:
        """Return the error for an exception of a launch file, with the places that led to it."""
        while error.__cause__ is not None:
            error = error.__cause__
        frames = [(frame.filename, frame.lineno or 0) for frame in traceback.extract_tb(error.__traceback__)]
        if isinstance(error, SyntaxError):
            frames.append((error.filename or "", error.lineno or 0))
        # The text of a KeyError is the representation of its argument.
        message = str(error.args[0]) if isinstance(error, KeyError) and error.args else str(error)
        names = sorted(get_packages_with_prefixes()) if type(error).__name__ == "PackageNotFoundError" else []
        refusal = error if isinstance(error, cls) else cls(type(error).__name__, message, names=names)
        refusal.places = refusal.places or frames
        return refusal


def event_writer(task: dict[str, Any]) -> Callable[..., None]:
    """Return a function that writes an event of a launch, from any thread: at its end, a file takes whole writes."""
    file = Path(task["events"]).open("ab", buffering=0)  # noqa: SIM115 - as long as this process is there

    def tell(event: str, **more: Any) -> None:
        file.write(json.dumps({"event": event, **more}).encode() + b"\n")

    return tell


def stand_in_of(stand_ins: Mapping[str, list[str]], program: str) -> list[str] | None:
    """Return the command that runs instead of a program: by PACKAGE/PROGRAM, by its package, or by its name."""
    package, is_of_package, _ = program.partition("/")
    keys = (program, package) if is_of_package and package else (Path(program).name,)
    return next((stand_ins[key] for key in keys if key in stand_ins), None)


def unsupported(what: str) -> LaunchError:
    """Return the error for a part of launch files that only `launch` has."""
    return LaunchError("unsupported", what)


def _refuse(*_: Any) -> Any:
    raise unsupported("a process or a file in a LaunchContext of its own")


class Context:
    """The state of a launch. Launch files in Python make one without arguments, in which only texts are known."""

    def __init__(
        self,
        start: Callable[[Part, dict[str, Any]], None] = _refuse,
        read: Callable[[Path], Any] = _refuse,
        folder: Path = Path(),
    ) -> None:
        self.start, self.read, self.folder = start, read, folder
        self.launch_configurations: dict[str, Any] = {}
        self.environment = os.environ
        self.files: list[str] = []
        self.declared: set[str] = set()
        self.used: set[str] = set()
        self.timers: list[tuple[float, Any]] = []
        self.handlers: list[Part] = []
        self.now = 0.0
        self.shutdown: str | None = None

    def perform_substitution(self, value: Any) -> str:
        """Return the text of a substitution, or of a list of them. Raise LaunchError."""
        if isinstance(value, Substitution):
            return str(value.run(self) if isinstance(value, Part) else value.perform(self))
        if isinstance(value, (list, tuple)):
            return "".join(map(self.perform_substitution, value))
        return "" if value is None else str(value)

    def is_true(self, value: Any) -> bool:
        """Return the truth of a text. Raise LaunchError."""
        text = self.perform_substitution(value).strip().lower()
        if text not in ("true", "false", "1", "0"):
            raise LaunchError("InvalidCondition", f"'{text}' is neither true nor false; write true, false, 1 or 0")
        return text in ("true", "1")

    def equals(self, name: str, expected: Any) -> bool:
        """Return True if a launch configuration has a value; None: it is not set."""
        self.used.add(name)
        text = None if expected is None else self.perform_substitution(expected)
        return bool(self.launch_configurations.get(name) == text)

    def visit(self, action: Any) -> None:
        """Run an action, or each of a list, if its condition is true. Raise LaunchError."""
        if isinstance(action, (list, tuple)):
            for part in action:
                self.visit(part)
            return
        if action is None:
            return
        place = getattr(action, "place", None)
        try:
            if not isinstance(action, Part):
                # Anything in a launch file in Python.
                raise unsupported(f"an action of the class '{type(action).__name__}'")  # noqa: TRY301 - gets its place below
            if action.condition is None or action.condition.run(self):
                result = action.run(self)
                if isinstance(result, dict):
                    self.start(action, result)
                else:
                    self.visit(result)
        except Exception as error:  # noqa: BLE001 - launch files are code, and may raise anything
            refusal = LaunchError.of(error)
            refusal.places[:0] = [place] if place and place[1] else []
            raise refusal from None

    def handle(self, event: str, process: Part | None, **more: Any) -> None:
        """Run the handlers of an event of a process, or of the launch."""
        for handler in list(self.handlers):
            words = handler.words_of(self).arguments if handler.kind.name.endswith(event) else None
            if words is None or (words.get("target_action") not in (None, process)):
                continue
            then = next((value for word, value in words.items() if word.startswith("on_")), None)
            self.follow(then, action=process, **more)

    def follow(self, then: Any, **event: Any) -> None:
        """Run what follows an event: actions, or a function of the event that returns them."""
        is_code = callable(then) and not isinstance(then, Part)
        self.visit(then(SimpleNamespace(**event), self) if is_code else then)


class Kind:
    """A row of the table, named by module and class of `launch`. A call makes a part, as that class would."""

    def __init__(self, name: str, function: Callable[..., Any]) -> None:
        self.name, self.function = name, function
        self.signature = inspect.signature(function)

    def __call__(self, *args: Any, **words: Any) -> Part:  # noqa: D102 - see the class
        frame = sys._getframe(1)  # noqa: SLF001 - the place in the launch file
        return Part(self, args, words, (frame.f_code.co_filename, frame.f_lineno))

    def part(self, args: tuple[Any, ...] = (), words: Any = None, place: tuple[str, int] = ("", 0)) -> Part:
        """Return a part of a launch file in XML or YAML; `words`: a dictionary, or a function that returns it."""
        return Part(self, args, {} if words is None else words, place)

    def __instancecheck__(self, other: object) -> bool:
        return isinstance(other, Part) and other.kind is self

    def __mro_entries__(self, _: Any) -> Any:
        raise unsupported(f"a class that is derived from '{self.name}'")


class Substitution:
    """The base of texts that are known when the launch runs; packages derive their own from it."""

    def perform(self, context: Context) -> str:
        """Return the text. Raise LaunchError."""
        raise NotImplementedError

    def __truediv__(self, other: Any) -> Part:
        return KINDS["launch.substitutions.PathJoinSubstitution"].part(([self, other],))


class Part(Substitution):
    """An action, a substitution, a condition or an event handler; `place`: its file and line."""

    def __init__(self, kind: Kind, args: tuple[Any, ...], words: Any, place: tuple[str, int]) -> None:
        self.kind, self.place = kind, place
        self.condition = None if callable(words) else words.pop("condition", None)
        self._args, self._words = args, words

    def words_of(self, context: Context) -> inspect.BoundArguments:
        """Return the arguments by their names. Raise LaunchError for one that is not known, or missing."""
        words = self._words() if callable(self._words) else self._words
        accepted = self.kind.signature.parameters
        if "executable" in accepted or "cmd" in accepted:
            words = {word: value for word, value in words.items() if word not in _WITHOUT_EFFECT}
        unknown = [word for word in words if word not in accepted]
        short = self.kind.name.rpartition(".")[2]
        if unknown and not any(parameter.kind is parameter.VAR_KEYWORD for parameter in accepted.values()):
            raise unsupported(f"'{unknown[0]}' of {short}")
        try:
            return self.kind.signature.bind(context, *self._args, **words)
        except TypeError as error:
            raise LaunchError("TypeError", f"{short}: {error}") from None

    def run(self, context: Context) -> Any:
        """Do it; return the text of a substitution, and the actions that follow an action. Raise LaunchError."""
        words = self.words_of(context)
        return self.kind.function(*words.args, **words.kwargs)

    def perform(self, context: Context) -> str:
        """Return the text, as launch files in Python ask for it."""
        return context.perform_substitution(self)

    def evaluate(self, context: Context) -> bool:
        """Return the truth of a condition, as launch files in Python ask for it."""
        return bool(self.run(context))

    def find(self, package: str) -> str:
        """Return the folder of another package, as launch files in Python ask FindPackageShare for it."""
        return str(self.kind.function(SimpleNamespace(perform_substitution=str), package))

    def add_action(self, action: Any) -> None:
        """Add an action to a launch description."""
        entities = (self._args[0] if self._args else self._words.get("initial_entities")) or ()
        self._words["initial_entities"] = [*entities, action]
        self._args = ()

    add_entity = add_action


KINDS: dict[str, Kind] = {}  # module and class in Python -> its row
ACTIONS: dict[str, tuple[Kind, dict[str, str]]] = {}
"""Tag in XML and YAML -> its row, and attribute or tag of a child -> the word of the row."""
SUBSTITUTIONS: dict[str, Kind] = {}  # name in `$(NAME ...)` -> its row


def row(*names: str, tag: str = "", text: str = "") -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Add a function to the table.

    `names`: its modules and classes in Python; "a.B|C" has two classes; `tag`: its tags in XML and YAML, then their
    attributes; ATTRIBUTE=WORD where they differ; `text`: its names in `$(NAME ...)`.
    """

    def add(function: Callable[..., Any]) -> Callable[..., Any]:
        kinds = []
        for name in names:
            module, _, classes = name.rpartition(".")
            kinds += [Kind(f"{module}.{one}", function) for one in classes.split("|")]
        KINDS.update({kind.name: kind for kind in kinds})
        SUBSTITUTIONS.update(dict.fromkeys(text.split(), kinds[0]))
        tags, _, attributes = tag.partition(":")
        pairs = {name: word or name for name, _, word in (pair.partition("=") for pair in attributes.split())}
        ACTIONS.update(dict.fromkeys(tags.split(), (kinds[0], pairs)))
        return function

    return add
