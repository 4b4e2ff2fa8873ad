"""Launches of either ROS: keys and commands that request them."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, Generic, Literal, TypeVar

from pydantic import AfterValidator, Field, GetJsonSchemaHandler, PrivateAttr, model_validator
from pydantic_core import CoreSchema
from typing_extensions import override

from sim_action.commands import CommandSource, Controller
from sim_action.core.errors import UsageError
from sim_action.core.field_types import FrozenModel, NamesFile, PositiveSeconds
from sim_action.core.records import dataclass
from sim_action.core.workspace import PathError, Workspace
from sim_action.core.yaml_document import SpecProblems
from sim_action.robot.documents.package_search import PACKAGE_FILE
from sim_action.world.scene import Scene

_Ros = TypeVar("_Ros")
_MAX_START_S: Final = 86_400  # in s: as long as anybody can mean
ALLOW_LOSSES: Final = "--allow-losses"
Program = Literal["rostest", "roslaunch", "launchtest"]


class ListedNode(FrozenModel):
    """A node of a list: a map of its program and its start options, or a short text."""

    short_form: ClassVar[str]  # the pattern of the text, for the schema

    @classmethod
    def expanded(cls, text: str) -> dict[str, str]:
        """Return the keys of the short form of a node. Raise ValueError."""
        raise NotImplementedError

    @model_validator(mode="before")
    @classmethod
    def _spelled_out(cls, value: Any) -> Any:
        return cls.expanded(value) if isinstance(value, str) else value

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Add the short form to the schema."""
        full = handler.resolve_ref_schema(handler(schema))
        full.pop("title", None)
        return {"anyOf": [{"type": "string", "pattern": cls.short_form}, full]}


_Node = TypeVar("_Node", bound=ListedNode)

StartTime = Annotated[
    PositiveSeconds,
    Field(le=_MAX_START_S, description="wall time that nodes may take to start; sim time waits for them"),
]


class Nodes(FrozenModel, Generic[_Node]):
    """The keys below `ros1` and `ros2`: the nodes to start, and where they are."""

    launch: Annotated[
        tuple[str, ...] | None,
        Field(min_length=1, description="launch file: its package, its name, and NAME:=VALUE for each argument"),
    ] = None
    nodes: Annotated[
        tuple[_Node, ...] | None,
        Field(
            min_length=1,
            description="list of nodes, instead of a launch file; each is a map, or a text such as package/program",
        ),
    ] = None
    allow_losses: Annotated[
        bool, Field(description="run without parts of the launch file that are not simulated; they are warnings then")
    ] = False
    workspace: Annotated[
        str | None,
        NamesFile(),
        Field(
            min_length=1,
            description="folder of the workspace, or in ROS 2 its install folder; default: the nearest workspace "
            "around the scenario, else its repository",
        ),
    ] = None
    start_within: StartTime = 20.0

    def problems(self, example: str) -> SpecProblems:
        """Yield that there is not exactly one of a launch file and a list of nodes, or that the file has no name."""
        if (self.launch is None) == (self.nodes is None):
            hint = "remove one of them" if self.launch else "give one of them"
            yield (), f"needs either 'launch' or 'nodes'; {hint}"
        elif self.launch and len(self.launch) < 2:
            yield ("launch",), f"needs a package and a launch file, such as [my_robot, {example}]"


def name_rule(pattern: str, rule: str) -> AfterValidator:
    """Return a validator of names that match a pattern; `rule`: in words, for its error."""

    def valid(name: str) -> str:
        if not re.fullmatch(pattern, name):
            raise ValueError(f"{rule}, found {name!r}")
        return name

    return AfterValidator(valid)


def argument_problem(argument: str) -> str | None:
    """Return why a text is no argument of a launch file; None if it is one."""
    name, sign, _ = argument.partition(":=")
    is_valid = sign and name.isidentifier()
    return None if is_valid else f"'{argument}' is not an argument of a launch file; write NAME:=VALUE"


def installed(find: Callable[[], _Ros], elsewhere: str) -> tuple[_Ros | None, str | None]:
    """Return the installation, or None and the reason why there is none; `elsewhere`: the one on other systems."""
    if sys.platform != "linux":
        return None, elsewhere
    try:
        return find(), None
    except UsageError as error:
        return None, str(error)


def unchecked_notes(key: str, launch: Sequence[str] | None, why_no_ros: str | None) -> tuple[str, ...]:
    """Return the notes on everything that cannot be checked before the nodes are started."""
    what = "launch file is read" if launch else "nodes are started"
    return (f"{key}: the {what} when the scenario runs", *([f"{key}: {why_no_ros}"] if why_no_ros else []))


def workspace_folder(stated: str | None, workspace: Workspace, is_workspace: Callable[[Path], bool]) -> Path:
    """Return the folder `stated`, else the nearest workspace around the scenario, else the root. Raises PathError."""
    if stated is not None:
        folder = workspace.file_or_folder(stated)
        if not folder.is_dir():
            raise PathError(f"'{stated}' is not a folder (looked for {folder})")
        return folder
    directory = workspace.directory
    around = (folder for folder in (directory, *directory.parents) if folder.is_relative_to(workspace.root))
    # A package may have a folder `src`, too, with its code.
    outside = (folder for folder in around if not (folder / PACKAGE_FILE).exists())
    return next(filter(is_workspace, outside), workspace.root)


def source_folder(workspace: Path) -> Path:
    """Return the folder of the packages of a workspace: its `src`, if there is one."""
    below = workspace / "src"
    return below if below.is_dir() and not (workspace / PACKAGE_FILE).exists() else workspace


class OpenCommands(CommandSource):
    """The commands of nodes that already run. No key of a scenario leads here."""

    _controller: Controller = PrivateAttr()

    @classmethod
    def of(cls, controller: Controller, rate: float) -> OpenCommands:
        """Return the commands of a controller, read `rate` times per second."""
        source = cls(rate=rate)
        source._controller = controller
        return source

    @override
    def open(self, scene: Scene) -> Controller:
        return self._controller


_OPTIONS: Final = {
    "workspace": "--workspace",
    "backend": "--backend",
    "seed": "--seed",
    "sim_time_limit": "--sim-time-limit",
    "real_time_factor": "--rtf",
    "wall_limit": "--wall-limit",
    "allows_losses": ALLOW_LOSSES,
    "strict": "--strict",
}
"""Field of a request -> its option on the command line."""


@dataclass(frozen=True, slots=True)
class LaunchRequest:
    """A call of rostest, roslaunch or launchtest; `more`: package and name of each further launch file.

    `sim_time_limit` is in s; None: the limits of the tests, or the default of the command. `real_time_factor` None: as
    fast as the nodes can follow. `wall_limit` is in s for the whole call; None: enough for all tests, and time in which
    sim time moves on does not count. `pass_env` names variables that nodes may see, in addition to the harmless ones.
    """

    program: Program
    package: str
    file: str
    arguments: tuple[str, ...] = ()
    workspace: Path = Path()
    backend: str = "auto"
    seed: int = 0
    sim_time_limit: float | None = None
    real_time_factor: float | None = None
    wall_limit: float | None = None
    replays: bool = True
    allows_losses: bool = False
    pass_env: tuple[str, ...] = ()
    more: tuple[tuple[str, str], ...] = ()
    strict: bool = False

    @property
    def files(self) -> tuple[tuple[str, str], ...]:
        """Package and name of each launch file."""
        return (self.package, self.file), *self.more

    @property
    def words(self) -> tuple[str, ...]:
        """The command line that repeats the call. Options come first, so that no argument is read as an option."""
        files = (word for pair in self.files for word in pair)
        return ("sim-action", self.program, *self._options(), *files, *self.arguments)

    def _options(self) -> Iterator[str]:
        """Yield the options that differ from their defaults."""
        usual = LaunchRequest(self.program, self.package, self.file)
        for name, option in _OPTIONS.items():
            if (value := getattr(self, name)) != getattr(usual, name):
                yield option
                if value is not True:
                    yield repr(value).removesuffix(".0") if isinstance(value, float) else str(value)
        for name in self.pass_env:
            yield from ("--pass-env", name)
