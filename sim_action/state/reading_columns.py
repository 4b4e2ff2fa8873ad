"""What the readings of each kind of sensor consist of: their columns, as traces keep them and assertions name them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from sim_action.core import units
from sim_action.core.units import Dimension


@dataclass(frozen=True, slots=True, eq=False)
class ReadingColumn:
    """One column.

    Attributes:
        dimension: of its numbers.
        axes: a letter for each number, such as "xyz"; "" for a single one.
        many: whether it holds any number of numbers instead, such as the ranges of a scan.
    """

    dimension: Dimension
    axes: str = ""
    many: bool = False

    @property
    def is_single(self) -> bool:
        """Whether it is one number."""
        return not self.axes and not self.many


_RATIO: Final = units.RATIO

READING_COLUMNS: Final[Mapping[str, Mapping[str, ReadingColumn]]] = MappingProxyType(
    {
        "camera": {
            "rgb": ReadingColumn(_RATIO, many=True),
            "depth": ReadingColumn(units.LENGTH, many=True),
        },
        "contact": {
            "touching": ReadingColumn(_RATIO),
            "force": ReadingColumn(units.FORCE),
        },
        "imu": {
            "orientation_xyzw": ReadingColumn(_RATIO, "xyzw"),
            "angular_velocity_xyz": ReadingColumn(units.ANGULAR_SPEED, "xyz"),
            "linear_acceleration_xyz": ReadingColumn(units.ACCELERATION, "xyz"),
        },
        "lidar": {
            "ranges": ReadingColumn(units.LENGTH, many=True),
        },
        "odometry": {
            "position_xyz": ReadingColumn(units.LENGTH, "xyz"),
            "orientation_xyzw": ReadingColumn(_RATIO, "xyzw"),
            "linear_xyz": ReadingColumn(units.SPEED, "xyz"),
            "angular_xyz": ReadingColumn(units.ANGULAR_SPEED, "xyz"),
        },
    }
)
"""Kind of sensor -> its columns by name."""
