"""What the command and the node `gazebo`, which roslaunch starts, say to each other: files in a folder of the call.

request.json                what is asked of every simulation
1/, 2/ ...                  one for each time that the node is started: rostest starts it anew for each test
    process                 the id of its process
    run.json                what became of the simulation
    trace.npz, replay.json.gz
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Final, Literal

from pydantic import Field, ValidationError

from sim_action.core.field_types import FrozenModel
from sim_action.core.files import read_at_most
from sim_action.results.outcome import Failure

FOLDER_VARIABLE: Final = "SIM_ACTION_ROS_RUN"
"""Names the folder of the call to the node."""

REQUEST_FILE: Final = "request.json"
PROCESS_FILE: Final = "process"
RUN_FILE: Final = "run.json"
TRACE_FILE: Final = "trace.npz"
REPLAY_FILE: Final = "replay.json.gz"

_MOST_BYTES: Final = 16_000_000

End = Literal["test over", "nodes gone", "time limit", "failed"]


class SimulationRequest(FrozenModel):
    """What the command asks of the node.

    Attributes:
        modules: the folder that has rospy.
        backend: the engine, or "auto".
        physics_rate: Hz; 10 ms are whole steps of it.
        sim_time_limit: s, after which the run is over; None: as long as there are nodes.
        real_time_factor: what the run is slowed down to; None: as fast as nodes can follow.
        replay: whether one is written.
    """

    modules: str
    backend: str = "auto"
    seed: int = 0
    physics_rate: float = 200.0
    sim_time_limit: float | None = None
    real_time_factor: float | None = None
    replay: bool = True


class SimulationResult(FrozenModel):
    """What became of the simulation, as the node tells it.

    Attributes:
        end: why it was over.
        failure: what went wrong, if that is why.
        sim_time: s at which it was over.
        first_command: s of sim time at which nodes told the robot something; None: they never did.
        travelled: m between the robot's first and last place on the ground plane.
        real_time_factor: sim time over wall time, from the start of the clock on.
        starting: s of wall time until the clock started.
        messages: topic -> how many were published on it or heard.
        in_step: whether nodes and clock were in lock-step from beginning to end.
    """

    end: End
    failure: Failure | None = None
    sim_time: float = 0.0
    first_command: float | None = None
    travelled: float | None = None
    digest: str | None = None
    real_time_factor: float | None = None
    starting: float = 0.0
    engine: str | None = None
    notes: tuple[str, ...] = ()
    messages: dict[str, int] = Field(default_factory=dict)
    in_step: bool = True

    def write(self, folder: Path) -> None:
        """As `run.json`; what reads it finds all of it, or nothing."""
        path = folder / RUN_FILE
        part = path.with_suffix(".part")
        part.write_text(self.model_dump_json(indent=2), encoding="utf-8")
        part.replace(path)

    @classmethod
    def read(cls, folder: Path) -> SimulationResult | None:
        """What a node has told; None: nothing, or nothing that can be understood."""
        try:
            data = read_at_most(folder / RUN_FILE, _MOST_BYTES)
            return None if data is None else cls.model_validate_json(data)
        except (OSError, ValidationError):
            return None


def new_run_folder(folder: Path) -> Path:
    """A folder for one more start of the node, below that of the call."""
    for number in count(1):
        try:
            (made := folder / str(number)).mkdir()
        except FileExistsError:
            continue
        return made
    raise AssertionError


def run_folders(folder: Path) -> list[Path]:
    """Those of all starts, the first one first."""
    numbers = sorted(int(path.name) for path in folder.iterdir() if path.name.isdecimal() and path.is_dir())
    return [folder / str(number) for number in numbers]


Program = Literal["rostest", "roslaunch"]


@dataclass(frozen=True, slots=True)
class LaunchRequest:
    """One call of a program of ROS, with Gazebo's place taken.

    Attributes:
        package: that the file is of.
        file: as it is named: the one of that name in the package, or a path.
        arguments: `NAME:=VALUE`.
        workspace: packages are in its `src`, or below it.
        sim_time_limit: s of a simulation; None: as the tests say.
        real_time_factor: what the clock is held to; None: as fast as nodes can follow.
        wall_limit: s of wall time for the whole call; None: enough for all tests.
        replays: whether they are stored.
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

    @property
    def words(self) -> tuple[str, ...]:
        """What is typed to have it again; options come first, so that no argument is taken for one."""
        return ("sim-action", self.program, *self._options(), self.package, self.file, *self.arguments)

    def _options(self) -> Iterator[str]:
        """Those that are not as they are by themselves."""
        if self.workspace != Path():
            yield from ("--workspace", str(self.workspace))
        if self.backend != "auto":
            yield from ("--backend", self.backend)
        if self.seed:
            yield from ("--seed", str(self.seed))
        numbers = {
            "--sim-time-limit": self.sim_time_limit,
            "--rtf": self.real_time_factor,
            "--wall-limit": self.wall_limit,
        }
        for option, number in numbers.items():
            if number is not None:
                yield from (option, repr(number).removesuffix(".0"))
