"""The parts of a robot model that only MJCF has, as data."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Literal

from sim_action.core.errors import Location
from sim_action.core.geometry import Pose
from sim_action.core.records import dataclass, field

MESH_OF_TEXT: Final = "mjcf:"
"""Prefix in `Visual.file` of the name of a mesh that an MJCF text contains."""


MotorKind = Literal["position", "velocity", "effort"]


@dataclass(frozen=True, slots=True)
class Motor:
    """The motor of a joint as an MJCF model states it. The engine simulates it with its own gains and limits.

    Attributes:
        actuator: its name in the model.
        kind: the quantity that its control sets: it is a position servo, a velocity servo, or exerts an effort.
        tendon: the fixed tendon on which it acts, together with its other joints; empty if it acts on the joint.
    """

    actuator: str
    kind: MotorKind
    tendon: str = ""

    @property
    def text(self) -> str:
        """Its kind, its name and its tendon."""
        kind = "motor" if self.kind == "effort" else f"{self.kind} servo"
        return f"{kind} '{self.actuator}'{f' on tendon {self.tendon!r}' if self.tendon else ''}"


@dataclass(frozen=True, slots=True)
class Keyframe:
    """A state of the robot that an MJCF model names.

    Attributes:
        joints: joint name -> rad (m if prismatic).
        base: pose of the base link, world frame; None if it is fixed.
        controls: actuator name -> control, in the actuator's own unit; empty if the keyframe states none.
        place: where it stands; None if that is unknown.
        flaw: the reason why it cannot be used; then it has no positions.
    """

    joints: Mapping[str, float]
    base: Pose | None = None
    controls: Mapping[str, float] = field(default_factory=dict)
    place: Location | None = None
    flaw: str = ""


def keyframe_of(keyframes: Mapping[str, Keyframe], wanted: str | int) -> Keyframe | None:
    """Return a keyframe by its name, or by its number in the file, from 0 on; None if there is none."""
    if str(wanted) in keyframes:
        return keyframes[str(wanted)]
    if isinstance(wanted, int) and wanted < len(keyframes):
        return list(keyframes.values())[wanted]
    return None


MeshBytes = tuple[bytes, bytes]
"""The points (P, 3) of a mesh as 32-bit floats, and its triangles (T, 3) as 32-bit integers."""


@dataclass(frozen=True, slots=True)
class FloorLook:
    """The look of the floor: one colour, or squares of two; red, green and blue from 0 to 1.

    Attributes:
        other: the colour of every other square; None without squares.
        square: m, the side of a square.
    """

    color: tuple[float, float, float]
    other: tuple[float, float, float] | None = None
    square: float = 1.0


@dataclass(frozen=True, slots=True)
class Mjcf:
    """The input of MuJoCo for a model in its own format; it names no file.

    Attributes:
        text: the model with its included files.
        models: name in the text -> text of each model to attach.
        meshes: mesh name -> its surface, for meshes that collide or have a mass.
        looked_at: geoms that are only drawn.
        actuators: names of all actuators; joints without one are passive if there is any.
        floor: m, height of the horizontal plane of the file, which is at the height 0 of the scenario; 0 without one.
        floor_look: how the file draws that plane; None if it does not say.
        excluded: pairs of bodies that <exclude> lets pass through each other.
        paired: pairs of geoms that <pair> lets collide, whatever their contype and conaffinity.
    """

    text: str
    models: Mapping[str, bytes] = field(repr=False)
    meshes: Mapping[str, MeshBytes] = field(repr=False)
    looked_at: frozenset[str] = frozenset()
    actuators: tuple[str, ...] = ()
    floor: float = 0.0
    excluded: frozenset[frozenset[str]] = frozenset()
    paired: frozenset[frozenset[str]] = frozenset()
    floor_look: FloorLook | None = None
