"""The files in the folder of a call of `rostest` or `roslaunch`: requests and results of simulations.

The command and the node `gazebo`, which roslaunch starts, exchange files in the folder of the call:

request.json                the request for every simulation
1/, 2/ ...                  one folder per start of the node: rostest starts it again for each test
    process                 process id of the node
    progress                touched while sim time moves on
    run.json                the result of the simulation
    trace.npz, replay.json.gz

A loss is a part of a world, a robot, a plugin or a launch file that Gazebo simulates and sim-action does not. It is an
error, because the test would check something else than its author thinks. `--allow-losses`, or the key `allow_losses`
of a scenario, turns it into a warning. A part that changes nothing that is simulated, measured or published is not a
loss: the tables in `world_tags` and `gazebo_plugins` give the reason for each.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import count
from pathlib import Path
from typing import Final, Literal

from pydantic import Field, ValidationError

from sim_action.core.errors import Location
from sim_action.core.field_types import FrozenModel
from sim_action.core.files import read_at_most
from sim_action.core.wording import counted, escaped_line
from sim_action.results.outcome import Failure
from sim_action.ros.launches import ALLOW_LOSSES
from sim_action.world.claims import NOT_SIMULATED, AuditWarning
from sim_action.world.world_files.losses import Loss

TITLE: Final = "not simulated"  # the title of failures
_MAX_REPORTED: Final = 20
FOLDER_VARIABLE: Final = "SIM_ACTION_ROS_RUN"  # the environment variable that holds the folder of the call
REQUEST_FILE: Final = "request.json"
PROCESS_FILE: Final = "process"
PROGRESS_FILE: Final = "progress"
RUN_FILE: Final = "run.json"
TRACE_FILE: Final = "trace.npz"
REPLAY_FILE: Final = "replay.json.gz"
_MOST_BYTES: Final = 16_000_000
End = Literal["test finished", "nodes finished", "time limit", "failed"]


def loss_failures(losses: Iterable[Loss]) -> tuple[Failure, ...]:
    """Return a failure for each of the first losses that are no remarks, and one that counts the rest."""
    without = f"; to run without it: {ALLOW_LOSSES}"
    return tuple(
        Failure(kind="invalid", title=TITLE, message=f"{loss.message}{without}", location=loss.location)
        for loss in _first(loss for loss in losses if not loss.is_remark)
    )


def loss_warnings(losses: Iterable[Loss], otherwise: Location) -> tuple[AuditWarning, ...]:
    """Return a warning for each of the first losses, and one that counts the rest; `otherwise`: for unknown places."""
    reported = _first(losses)
    return tuple(
        AuditWarning(rule=NOT_SIMULATED, message=loss.message, location=loss.location or otherwise) for loss in reported
    )


def _first(losses: Iterable[Loss]) -> Iterator[Loss]:
    unique = [Loss(message=escaped_line(loss.message), location=loss.location) for loss in dict.fromkeys(losses)]
    yield from unique[:_MAX_REPORTED]
    if more := unique[_MAX_REPORTED:]:
        yield Loss(message=f"{counted(len(more), 'more part')} of the launch", location=more[0].location)


class SimulationRequest(FrozenModel):
    """The request of the command to the node `gazebo`; `modules`: the folder that has rospy.

    `physics_rate` is in Hz; 10 ms are a whole number of steps. `sim_time_limit`: s after which the run ends, if no test
    states its own; None: as long as there are nodes. `limits_tests`: True if it holds for tests too. `real_time_factor`
    None: as fast as the nodes can follow.
    """

    modules: str
    backend: str = "auto"
    seed: int = 0
    physics_rate: float = 200.0
    sim_time_limit: float | None = None
    limits_tests: bool = False
    real_time_factor: float | None = None
    replay: bool = True
    allows_losses: bool = False


class SimulationResult(FrozenModel):
    """The result of a simulation, as the node writes it. Times are s of sim time.

    `first_command` None: there was none. `travelled`: m between the first and last place on the ground plane.
    `messages`: topic -> their number. `in_step`: True if nodes and clock were in lock-step throughout. `missing_world`:
    the world file that does not exist, if that is the failure. `claims`: rule -> finding of the audit of claims after
    the run.
    """

    end: End
    failure: Failure | None = None
    sim_time: float = 0.0
    sim_time_limit: float | None = None
    first_command: float | None = None
    travelled: float | None = None
    digest: str | None = None
    real_time_factor: float | None = None
    engine: str | None = None
    notes: tuple[str, ...] = ()
    messages: dict[str, int] = Field(default_factory=dict)
    in_step: bool = True
    losses: tuple[Loss, ...] = ()
    missing_world: str | None = None
    claims: dict[str, str] = Field(default_factory=dict)

    def write(self, folder: Path) -> None:
        """Write `run.json` in one step: a reader finds all of it or no file."""
        path = folder / RUN_FILE
        part = path.with_suffix(".part")
        part.write_text(self.model_dump_json(indent=2), encoding="utf-8")
        part.replace(path)

    @classmethod
    def read(cls, folder: Path) -> SimulationResult | None:
        """Read `run.json`; None if it is missing or damaged."""
        try:
            data = read_at_most(folder / RUN_FILE, _MOST_BYTES)
            return None if data is None else cls.model_validate_json(data)
        except (OSError, ValidationError):
            return None


def new_run_folder(folder: Path) -> Path:
    """Make and return the folder of one more start of the node, in the folder of the call."""
    for number in count(1):
        try:
            (made := folder / str(number)).mkdir()
        except FileExistsError:
            continue
        return made
    raise AssertionError


def run_folders(folder: Path) -> list[Path]:
    """Return the folders of all starts, in their order."""
    numbers = sorted(int(path.name) for path in folder.iterdir() if path.name.isdecimal() and path.is_dir())
    return [folder / str(number) for number in numbers]
