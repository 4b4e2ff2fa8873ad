"""The parts of launch files that a scenario does not replace: further models, other worlds, and controllers.

The scenario is the robot, the world, the drive and the sensors. Programs of Gazebo and ros_control are not started.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import PurePath
from typing import Final

from sim_action.core.errors import SourceProblem
from sim_action.core.records import dataclass

_SERVERS: Final = frozenset({"gz", "ign", "gazebo", "gzserver", "debug", "gdbrun", "perf"})
_SPAWNERS: Final = frozenset(
    {"ros_gz_sim/create", "ros_ign_gazebo/create", "gazebo_ros/spawn_entity.py", "gazebo_ros/spawn_model"}
)
_CONTROLLER_SPAWNERS: Final = frozenset({"controller_manager/spawner", "controller_manager/spawner.py"})
_MANAGER: Final = "controller_manager/controller_manager"
_WORLD_SUFFIXES: Final = frozenset({".sdf", ".world"})
_EMPTY_WORLDS: Final = frozenset({"empty", "empty_world"})
# Models from these sources are robots as a rule; files hold robots and objects.
_FROM_FILE: Final = frozenset({"-file", "--file", "-database", "-sdf"})
_NAMES: Final = ("-name", "--name", "-entity", "entity_name", "-model")
_VALUED: Final = frozenset(
    {
        *("-c", "--controller-manager", "-p", "--param-file", "-n", "--namespace", "-t", "--controller-type"),
        *("--controller-manager-timeout", "--service-call-timeout", "--switch-timeout", "--controller-ros-args"),
        *("--timeout", "--shutdown-timeout"),
    }
)


@dataclass(frozen=True, slots=True)
class LeftOutProgram:
    """A program that is not started; `program`: PACKAGE/PROGRAM, or the program alone."""

    program: str
    args: tuple[str, ...]


def left_out_notes(programs: Iterable[LeftOutProgram]) -> Iterator[str]:
    """Yield a note on the programs of a launch that are not started, if there are any."""
    if names := ", ".join(dict.fromkeys(program.program for program in programs)):
        yield f"not started, because sim-action is the simulator: {names}"


def accepted_losses(
    losses: Iterable[str], key: str, *, allowed: bool, remedy: str = "set allow_losses: true"
) -> list[str]:
    """Return the messages of lost parts. Raises SourceProblem if there are any and they are not allowed."""
    messages = list(losses)
    if messages and not allowed:
        raise SourceProblem(f"{'; '.join(messages)}; to run without it, {remedy}", key)
    return messages


def lost_parts(
    programs: Sequence[LeftOutProgram],
    lost_controller: Callable[[str, LeftOutProgram], str | None],
    worlds: Iterable[str] = (),
) -> Iterator[str]:
    """Yield a message for each lost part; `lost_controller`: returns that for a controller of a program, if it is."""
    stated = (*worlds, *(world for program in programs for world in _worlds(program)))
    for world in map(PurePath, filter(None, dict.fromkeys(stated))):
        if world.stem not in _EMPTY_WORLDS:
            yield f"the world '{world.name}' of the launch file is not simulated: add its objects to 'world'"
    spawned = [program.args for program in programs if program.program in _SPAWNERS]
    # The robot is the first one that can be no object, else the first one.
    robot = next((place for place, args in enumerate(spawned) if _FROM_FILE.isdisjoint(args)), 0)
    for args in (args for place, args in enumerate(spawned) if place != robot):
        name = next((value for option, value in pairwise(args) if option in _NAMES), "without a name")
        yield f"the model '{name}' is not spawned: the scenario has one robot, and its objects are in 'world'"
    for program in programs:
        yield from filter(None, (lost_controller(name, program) for name in _controllers(program)))


def _worlds(program: LeftOutProgram) -> Iterator[str]:
    if PurePath(program.program).name in _SERVERS:
        words = (word for argument in program.args for word in argument.split())
        yield from (word for word in words if PurePath(word).suffix in _WORLD_SUFFIXES)


def _controllers(program: LeftOutProgram) -> Iterator[str]:
    """Yield the names of the controllers that a program would load."""
    args = program.args
    if program.program == _MANAGER and args[:1] in (("spawn",), ("load",)):
        args = args[1:]
    elif program.program not in _CONTROLLER_SPAWNERS:
        return
    is_value = False
    for word in args:
        if word == "--ros-args":
            return
        if not is_value and not word.startswith("-"):
            yield word
        is_value = word in _VALUED
