"""What a golden trajectory is of, and how its file begins; without arrays, for those that only read scenarios."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from sim_action.core.messages import escaped_line

RESOLUTION: Final = 1e-4
"""In m and rad: what values are rounded to."""

TITLE: Final = "# sim-action golden trajectory "
"""How the first line begins; the version of the format and the robot follow."""

VERSION: Final = "1"
_BASE: Final = ("time_s", "x_m", "y_m", "z_m", "yaw_rad")


class GoldenError(ValueError):
    """A file that is no golden trajectory of this robot; the message begins with its line."""


@dataclass(frozen=True, slots=True)
class GoldenForm:
    """What a golden trajectory is of: the robot's own name, and the joints that are kept, each with its unit."""

    robot: str
    joints: tuple[tuple[str, str], ...] = ()

    @property
    def columns(self) -> tuple[str, ...]:
        """The header, such as time_s, x_m, ..., elbow_rad."""
        return (*_BASE, *(f"{name}_{unit}" for name, unit in self.joints))

    @property
    def joint_names(self) -> tuple[str, ...]:
        """In the order of their columns."""
        return tuple(name for name, _ in self.joints)

    @property
    def title(self) -> str:
        """The first line of a file."""
        return f"{TITLE}{VERSION}: {escaped_line(self.robot)}"
