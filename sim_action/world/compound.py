"""Bodies of several shapes, and stated mass properties: `shapes`, `center_of_mass` and `inertia` of an object."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Final, Protocol, Self

from pydantic import Field, model_validator

from sim_action.core.field_types import (
    FrozenModel,
    KilogramSquareMetres,
    Metres,
    NonNegativeKilogramSquareMetres,
    RelativePose,
)
from sim_action.core.geometry import Vector3, symmetric_eigenvalues
from sim_action.world.shapes import MAX_LENGTH_M, Cylinder, MeshFile, Ramp, Size, Sphere, Stairs

if TYPE_CHECKING:
    from sim_action.world.parts import Part

SHAPES: Final = ("box", "cylinder", "sphere", "ramp", "stairs", "mesh")
"""The keys of the shapes of which a body can have several."""

MAX_SHAPES: Final = 1000

Arm = Annotated[Metres, Field(ge=-MAX_LENGTH_M, le=MAX_LENGTH_M)]

# Moments may break the triangle inequality by this share: files are rounded.
_ROUNDING: Final = 1e-3

# The error of a computed principal moment, as a share of the largest one, is less.
_SMALLEST_SHARE: Final = 1e-7


class ShapePose(RelativePose):
    """The pose of a shape in the frame of its object."""


class Shape(FrozenModel):
    """One of several shapes of an object, which are rigidly joined and touch others under one name."""

    box: Annotated[tuple[Size, Size, Size] | None, Field(description="full size in x, y and z")] = None
    cylinder: Annotated[Cylinder | None, Field(description="cylinder about its own z axis")] = None
    sphere: Sphere | None = None
    ramp: Annotated[Ramp | None, Field(description="wedge that rises along its own x axis")] = None
    stairs: Annotated[Stairs | None, Field(description="steps that rise along their own x axis")] = None
    mesh: Annotated[MeshFile | None, Field(description="triangle mesh from a file; with a mass, its convex hull")] = (
        None
    )
    pose: Annotated[ShapePose, Field(description="pose of the shape in the frame of the object")] = (
        ShapePose.model_construct()
    )

    @model_validator(mode="after")
    def _is_one_shape(self) -> Self:
        found = [f"'{shape}'" for shape in SHAPES if getattr(self, shape) is not None]
        if len(found) > 1:
            raise ValueError(f"{' and '.join(found)} are in one shape; begin each shape with '- '")
        if not found:
            raise ValueError(f"needs exactly one of {', '.join(SHAPES)}")
        return self

    @property
    def kind(self) -> str:
        """The YAML key of the shape."""
        return next(shape for shape in SHAPES if getattr(self, shape) is not None)

    def parts(self) -> Sequence[Part]:
        """Return the parts of a shape that is not read from a file, in the frame of the object."""
        from sim_action.world.parts import moved

        return [moved(part, self.pose.pose) for part in solid_parts(self)]


class _Solid(Protocol):
    """A spec with the keys of solids, of which one is set."""

    @property
    def box(self) -> Vector3 | None: ...
    @property
    def cylinder(self) -> Cylinder | None: ...
    @property
    def sphere(self) -> Sphere | None: ...
    @property
    def ramp(self) -> Ramp | None: ...
    @property
    def stairs(self) -> Stairs | None: ...


def solid_parts(shape: _Solid) -> Sequence[Part]:
    """Return the parts of a box, cylinder, sphere, ramp or flight of stairs, in its own frame."""
    from sim_action.world.parts import BoxPart, CylinderPart, SpherePart

    if shape.box is not None:
        return (BoxPart(shape.box),)
    if shape.cylinder is not None:
        return (CylinderPart(shape.cylinder.radius, shape.cylinder.height),)
    if shape.sphere is not None:
        return (SpherePart(shape.sphere.radius),)
    made = shape.ramp or shape.stairs
    assert made is not None
    return made.parts()


class Inertia(FrozenModel):
    """The moments of inertia about the centre of mass, along the axes of the object."""

    ixx: NonNegativeKilogramSquareMetres
    iyy: NonNegativeKilogramSquareMetres
    izz: NonNegativeKilogramSquareMetres
    ixy: KilogramSquareMetres = 0.0
    ixz: KilogramSquareMetres = 0.0
    iyz: KilogramSquareMetres = 0.0

    @model_validator(mode="after")
    def _is_possible(self) -> Self:
        diagonal, products = (self.ixx, self.iyy, self.izz), (self.ixy, self.ixz, self.iyz)
        is_turned = any(products)
        least, middle, most = sorted(symmetric_eigenvalues(diagonal, *products) if is_turned else diagonal)
        smallest = _SMALLEST_SHARE * most if is_turned else 0.0
        if least <= smallest or most > (least + middle) * (1 + _ROUNDING):
            found = " ".join(f"{moment:g}" for moment in ((least, middle, most) if is_turned else diagonal))
            kind = "principal moments" if is_turned else "moments"
            rule = "each is greater than 0 and at most the sum of the others"
            raise ValueError(f"no body has the {kind} {found}: {rule}")
        return self

    @property
    def rows(self) -> tuple[tuple[float, float, float], ...]:
        """The tensor in kg m^2."""
        return (self.ixx, self.ixy, self.ixz), (self.ixy, self.iyy, self.iyz), (self.ixz, self.iyz, self.izz)
