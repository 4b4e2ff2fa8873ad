"""One visualization_msgs/Marker."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, Literal

from sim_action.core.geometry import Pose, Vector3
from sim_action.recording.export.ros2.cdr import CdrForm

Kind = Literal["cube", "sphere", "cylinder", "sphere list", "triangle list"]
_TYPES: Final[dict[Kind, int]] = {"cube": 1, "sphere": 2, "cylinder": 3, "sphere list": 7, "triangle list": 11}


@dataclass(frozen=True, slots=True)
class Marker:
    """What does not change of a marker; its time and its points are gaps.

    Attributes:
        group: and `number` tell it from others.
        scale: m; of a sphere its diameters, of a cylinder those of its circle, and its height.
        points: how many.
        lifetime: s, 0 for ever.
    """

    kind: Kind
    frame: str
    group: str
    number: int = 0
    pose: Pose = field(default_factory=Pose)
    scale: Vector3 = (1.0, 1.0, 1.0)
    colour: Vector3 = (0.8, 0.8, 0.8)
    points: int = 0
    lifetime: int = 0

    def add_to(self, form: CdrForm) -> None:
        """Appends it to a message: gaps for 2 numbers of the time, and for 3 of each point, if it has some."""
        form.gap("<i4", 2).string(self.frame).string(self.group).fixed("<i4", self.number, _TYPES[self.kind], 0)
        form.fixed("<f8", *self.pose.position_xyz, *self.pose.orientation_xyzw, *self.scale)
        form.fixed("<f4", *self.colour, 1.0).fixed("<i4", self.lifetime, 0).fixed("u1", not self.lifetime)
        form.fixed("<u4", self.points).gap("<f8", 3 * self.points)
        self._add_what_is_empty(form)

    def _add_what_is_empty(self, form: CdrForm) -> None:
        form.fixed("<u4", 0)  # colors
        form.string("").fixed("<i4", 0, 0).string("").string("").fixed("<u4", 0, 0)  # texture, uv_coordinates
        form.string("").string("").string("").fixed("<u4", 0).fixed("u1", 0)  # text, mesh_resource, mesh_file
