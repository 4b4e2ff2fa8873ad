"""What `sim-action rostest` and `sim-action roslaunch` are asked for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

Program = Literal["rostest", "roslaunch"]


@dataclass(frozen=True, slots=True)
class RosRequest:
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
