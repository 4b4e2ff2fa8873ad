"""Check links: their shapes (kinds, sizes, units), masses and moments of inertia; find and clean their meshes.

Inertias must be present, physically possible, and in proportion to the size of the link.

The bounds on proportions are wide, because exporters round and shapes are simplified. A link that weighs almost
nothing compared to the model may have a placeholder inertia. No real robot in pybullet_data comes near the bounds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from sim_action.core import geometry
from sim_action.core.errors import Location
from sim_action.core.files import cache_folder
from sim_action.core.geometry import ZERO, Box, Vector3
from sim_action.core.records import replace
from sim_action.robot.audit.joints import is_free_base
from sim_action.robot.documents.packages import PackageError, Packages
from sim_action.robot.model.draft import (
    MAX_PART_SIZE_M,
    SHAPES,
    InertialDraft,
    LinkDraft,
    MeshDraft,
    OriginDraft,
    RobotDraft,
    ShapeDraft,
)
from sim_action.robot.model.findings import Finding, finding
from sim_action.robot.model.robot_model import ENGINE_MARGIN_M, WORLD, Link, Moments, Shape

if TYPE_CHECKING:
    from sim_action.meshes import CleanMesh


# Beyond this size, a part that is this many times as large as all usual ones was probably drawn in millimetres.
_MAX_USUAL_SIZE_M: Final = 10.0
_MAX_RATIO: Final = 100.0
_TURN: Final = 6.3  # 360 deg in rad, rounded up
KINDS: Final = (*SHAPES, "mesh")


def presence(draft: RobotDraft) -> Iterator[Finding]:
    """Yield a finding if there is no link."""
    if not draft.links:
        yield finding("not-a-robot", "the model has no <link>; at least one is required", draft.place)


def kinds(draft: RobotDraft) -> Iterator[Finding]:
    """Yield shapes that URDF does not define."""
    for shape in (shape for link in draft.links for shape in (*link.collisions, *link.visuals)):
        if shape.kind not in KINDS:
            yield finding(
                "unknown-shape", f"unknown shape <{shape.kind}>; the shapes are {', '.join(KINDS)}", shape.place
            )


def sizes(draft: RobotDraft) -> Iterator[Finding]:
    """Yield shapes with a size that is not greater than 0."""
    for shape in _shapes(draft):
        if shape.is_empty:
            message = f"<{shape.kind}> has no size, so nothing can touch it: it is ignored"
            yield finding("empty-shape", message, shape.place)
            continue
        for name, lengths in shape.sizes.items():
            if min(lengths) <= 0:
                stated = " ".join(f"{length:g}" for length in lengths)
                requirement = f"the {name}" if name != "size" else "all sizes"
                message = f'<{shape.kind} {name}="{stated}">: {requirement} must be greater than 0'
                yield finding("bad-shape", message, shape.place)


def extents(draft: RobotDraft) -> Iterator[Finding]:
    """Yield shapes and offsets that are too large for a robot."""
    sizes = [(shape, _extent(shape)) for shape in _shapes(draft)]
    usual = max((size for _, size in sizes if size <= _MAX_USUAL_SIZE_M), default=0.0)
    # A mesh can be larger than the other parts.
    is_known = usual > 0 and not any(shape.mesh for link in draft.links for shape in link.collisions)
    for shape, size in sizes:
        if size > MAX_PART_SIZE_M:
            message = f"<{shape.kind}> is {size:g} m large; models are in metres: is it in millimetres?"
            yield finding("absurd-size", message, shape.place)
        elif is_known and size > _MAX_USUAL_SIZE_M and size > _MAX_RATIO * usual:
            message = f"<{shape.kind}> is {size:g} m large, but the other parts at most {usual:g} m"
            yield finding("absurd-size", f"{message}: is it in millimetres?", shape.place)
    for origin, place in _origins(draft):
        offset = max(map(abs, origin.xyz or ZERO))
        if offset > MAX_PART_SIZE_M:
            message = f"<origin> is {offset:g} m away; URDF is in metres: is it in millimetres?"
            yield finding("absurd-size", message, place)


def angles(draft: RobotDraft) -> Iterator[Finding]:
    """Yield origins that are rotated by more than a full turn."""
    for origin, place in _origins(draft):
        largest = max(map(abs, origin.rpy or ZERO))
        if largest > _TURN:
            message = f"<origin> is rotated by {largest:g} rad, more than a full turn: is it in degrees?"
            yield finding("odd-angle", message, place)


def collisions(draft: RobotDraft) -> Iterator[Finding]:
    """Yield a finding if no link has a collision shape."""
    if not any(link.collisions for link in draft.links):
        message = "no link has a <collision>: the robot falls through the ground"
        yield finding("no-collision-shape", message, draft.place)


def _shapes(draft: RobotDraft) -> Iterator[ShapeDraft]:
    """Yield the plain collision shapes, one kind after the other."""
    for kind in SHAPES:
        yield from (shape for link in draft.links for shape in link.collisions if shape.kind == kind)


def _origins(draft: RobotDraft) -> Iterator[tuple[OriginDraft, Location]]:
    """Yield the stated origins of joints, collisions and masses, with their places."""
    origins = [joint.origin for joint in draft.joints]
    origins += [shape.origin for link in draft.links for shape in link.collisions]
    origins += [link.inertial.origin for link in draft.links if link.inertial is not None]
    yield from ((origin, origin.place) for origin in origins if origin.place is not None)


def _extent(shape: ShapeDraft) -> float:
    return max((max(sizes) * (2 if name == "radius" else 1) for name, sizes in shape.sizes.items()), default=0.0)


_ROUNDING: Final = 1e-3  # exporters round: smaller deviations are not reported

# A repair that adds this share of the largest moment does not change the motion: it is a note.
_SMALL_SHARE: Final = 0.01

# Engines round when they compute the principal axes. A flat plate, which is correct, lies exactly on the bound.
_REPAIRED: Final = 1e-6

_MAX_GYRATION_RATIO: Final = 100.0
"""Bounds on the radius of gyration divided by the reach of the link; 0.1 to 1 for a body that fills its shapes."""

_MIN_GYRATION_RATIO: Final = 0.01
_NEGLIGIBLE: Final = 0.01  # a share of the mass of the model
_MAX_DENSITY: Final = 25_000.0  # kg/m^3; osmium has 22,600
_MIN_THICKNESS_M: Final = 1e-3  # an engine treats a flat mesh as this thick


def masses(draft: RobotDraft) -> Iterator[Finding]:
    """Yield masses that are negative or 0."""
    bodies: RigidBodies | None = None
    for link in draft.links:
        if link.inertial is None or link.inertial.mass > 0:
            continue
        value, name, place = link.inertial.mass, link.name, link.inertial.mass_place
        bodies = bodies or RigidBodies(draft)
        if value < 0:
            yield finding("negative-mass", f'<mass value="{value:g}">: a mass must not be negative', place)
        elif bodies.holds_mass(name):
            message = f"link '{name}' has a mass of 0, and is fixed to others that have one: it adds nothing"
            yield finding("massless-frame", message, place)
        elif bodies.is_base(name):
            message = f"base link '{name}' has a mass of 0, so it is fixed; to let it move, give it a mass"
            yield finding("massless-base", message, place)
        else:
            message = f"link '{name}' moves, but has a mass of 0: state the mass, or remove <inertial>"
            yield finding("zero-mass", message, place)


class RigidBodies:
    """The links of a model in groups that fixed joints hold together."""

    def __init__(self, draft: RobotDraft) -> None:
        held = {joint.child: joint.parent for joint in draft.joints if joint.type == "fixed"}
        self._moved = {joint.child for joint in draft.joints} - held.keys()
        self._first: dict[str, str] = {}
        self._masses: dict[str, float] = {}
        for link in draft.links:
            first = link.name
            while first in held:
                first = held[first]
            self._first[link.name] = first
            mass = 0.0 if link.inertial is None else link.inertial.mass
            self._masses[first] = self._masses.get(first, 0.0) + max(0.0, mass)

    def holds_mass(self, link: str) -> bool:
        """Return True if a link is fixed to one with a mass, or to the world."""
        return self._masses[self._first[link]] > 0 or self.is_in_world(link)

    def is_in_world(self, link: str) -> bool:
        """Return True if a link is fixed to the world."""
        return self._first[link] == WORLD

    def is_base(self, link: str) -> bool:
        """Return True if a link is the base, or is fixed to it."""
        return self._first[link] not in self._moved


def tensors(draft: RobotDraft) -> Iterator[Finding]:
    """Yield inertias whose principal moments are not positive, or break the triangle inequality."""
    for link in draft.links:
        if link.inertial is not None and link.inertial.mass != 0:
            yield from _tensor(link.name, link.inertial)


def _tensor(link: str, inertial: InertialDraft) -> Iterator[Finding]:
    a, b, c = principal_moments(inertial.moments)
    moments = f"principal moments of inertia {a:.3g}, {b:.3g}, {c:.3g} kg m^2"
    if not any(inertial.moments):
        message = f"{moments}: the mass counts as a ball of 5 cm radius; state the moments"
        yield finding("zero-inertia", message, inertial.moments_place)
        return
    lacking = max(-a, c - a - b)
    rounding = max(_SMALL_SHARE * c, 2 * inertial.last_digit)
    if a > 0 and lacking <= _ROUNDING * (a + b):
        return
    requirement = (
        "all of them must be greater than 0" if a <= 0 else "none may be greater than the sum of the other two"
    )
    more = increase(inertial.moments)
    used = f"{a + more:.3g}, {b + more:.3g}, {c + more:.3g} kg m^2 are used, the smallest increase that is possible"
    if lacking <= rounding:
        message = f"{moments}: {requirement}; they miss this only by rounding: {used}"
        yield finding("rounded-inertia", message, inertial.moments_place)
    elif -a <= rounding < c:
        message = f"link '{link}' has {moments}: {requirement}; {used}; state the moments about the centre of mass"
        yield finding("uneven-inertia", message, inertial.moments_place)
    else:
        yield finding("impossible-inertia", f"{moments}: {requirement}", inertial.moments_place)


def increase(moments: Moments) -> float:
    """Return the smallest moment in kg m^2 that makes an inertia possible if it is added about every axis."""
    least, middle, most = principal_moments(moments)
    lacking = most - least - middle + _REPAIRED * most
    return lacking - min(0.0, least) if lacking > 0 else 0.0


def inertials(draft: RobotDraft) -> Iterator[Finding]:
    """Yield links without <inertial>, and a model in which no link has a mass."""
    is_fixed = any(link.name == WORLD for link in draft.links)
    if is_fixed and all(joint.type == "fixed" for joint in draft.joints):
        return  # Nothing moves, so no mass has an effect.
    if not any(link.inertial.mass for link in draft.links if link.inertial is not None):
        message = "no link of the model has a mass: each gets a negligible one, and the base must be fixed"
        yield finding("massless-model", message, draft.place)
        return
    free_of_mass = {*(joint.parent for joint in draft.joints if is_free_base(draft, joint))}
    bodies = RigidBodies(draft)
    for link in draft.links:
        if link.inertial is None and link.name not in free_of_mass and not bodies.is_in_world(link.name):
            message = f"link '{link.name}' has no <inertial>: it gets a negligible mass"
            yield finding("missing-inertia", message, link.place)


def principal_moments(moments: Moments) -> tuple[float, float, float]:
    """Return the principal moments in kg m^2, in rising order."""
    xx, xy, xz, yy, yz, zz = moments
    least, middle, most = sorted(geometry.symmetric_eigenvalues((xx, yy, zz), xy, xz, yz))
    return least, middle, most


def proportions(draft: RobotDraft, links: Sequence[Link]) -> Iterator[Finding]:
    """Yield inertias and masses that do not fit the size of their links, which know the sizes of their meshes."""
    shaped = {link.name: link for link in links if link.collisions and link.mass}
    total = sum(link.mass or 0.0 for link in links)
    for drafted in draft.links:
        link = shaped.get(drafted.name)
        if link is not None and drafted.inertial is not None:
            yield from _inertia(drafted.inertial, link, _NEGLIGIBLE * total)
    yield from _density(draft, shaped)


def _inertia(inertial: InertialDraft, link: Link, least_mass: float) -> Iterator[Finding]:
    if inertial.mass < 0:
        return
    reach = max(_distance(shape, link.centre_of_mass_xyz) + _half_diagonal(shape) for shape in link.collisions)
    least, _, moment = principal_moments(inertial.moments)
    if least <= 0:
        return  # impossible-inertia reports it
    radius = math.sqrt(moment / inertial.mass)
    is_far = math.sqrt(moment / max(inertial.mass, least_mass)) > _MAX_GYRATION_RATIO * reach
    if is_far or radius < _MIN_GYRATION_RATIO * max(map(_half_diagonal, link.collisions)):
        problem = (
            f"link '{link.name}' has {moment:.3g} kg m^2 at {link.mass:.3g} kg, like a point mass at {radius:.2g} m"
        )
        message = f"{problem}, but the link extends only {reach:.2g} m from its centre of mass: is the unit kg m^2?"
        yield finding("odd-inertia", message, inertial.moments_place)


def _distance(shape: Shape, point: Vector3) -> float:
    x, y, z = ((low + high) / 2 for low, high in zip(shape.lower_xyz, shape.upper_xyz, strict=True))
    middle = geometry.compose(shape.pose, geometry.Pose((x, y, z)))
    return math.dist(middle.position_xyz, point)


def _half_diagonal(shape: Shape) -> float:
    return math.hypot(*_sizes(shape)) / 2


def _sizes(shape: Shape) -> Iterator[float]:
    return (max(high - low, _MIN_THICKNESS_M) for low, high in zip(shape.lower_xyz, shape.upper_xyz, strict=True))


def _density(draft: RobotDraft, shaped: Mapping[str, Link]) -> Iterator[Finding]:
    """Yield a finding if all shapes together are too dense; a single shape may be a placeholder."""
    mass = sum(link.mass or 0.0 for link in shaped.values())
    volume = sum(math.prod(_sizes(shape)) for link in shaped.values() for shape in link.collisions)
    if mass > _MAX_DENSITY * volume:
        heaviest = max(shaped.values(), key=lambda link: link.mass or 0.0)
        inertials = (link.inertial for link in draft.links if link.name == heaviest.name)
        place = next(inertial.mass_place for inertial in inertials if inertial is not None)
        density = f"{mass:.4g} kg in at most {volume:.2g} m^3, a density of {mass / volume:,.0f} kg/m^3"
        yield finding("odd-mass", f"{density}: are masses in grams, or sizes too small?", place)


# A smaller mesh consists of that margin only.
_MIN_MESH_SIZE_M: Final = 0.001
_ODD_SHAPES: Final = {
    "concave": ("concave-mesh", "is concave or open: its convex hull collides instead; split it into convex parts"),
    "flat": ("flat-mesh", "has no volume: it collides as a plate as thick as the engine's margin; give it a thickness"),
}


class MeshResolver:
    """Finds the meshes of a robot, and makes a clean copy of each one that collides.

    `path`: the file of the model; `findings` grows meanwhile.
    """

    def __init__(self, path: Path, packages: Packages) -> None:
        self._path, self._packages = path, packages
        self.findings: list[Finding] = []
        self._reported = set[tuple[str, Path]]()

    def resolved(self, draft: RobotDraft) -> RobotDraft:
        """Return a robot whose meshes are resolved, except for those with a finding that says why not."""
        return replace(draft, links=tuple(map(self._link, draft.links)))

    def _link(self, link: LinkDraft) -> LinkDraft:
        if not any(shape.mesh for shape in (*link.collisions, *link.visuals)):
            return link
        collisions = tuple(map(self._collision, link.collisions))
        return replace(link, collisions=collisions, visuals=tuple(map(self._visual, link.visuals)))

    def _visual(self, visual: ShapeDraft) -> ShapeDraft:
        if visual.mesh is None:
            return visual
        return replace(visual, mesh=replace(visual.mesh, path=self._file(visual, visual.mesh, "missing-visual")))

    def _collision(self, shape: ShapeDraft) -> ShapeDraft:
        if shape.mesh is None:
            return shape
        path = self._file(shape, shape.mesh, "missing-mesh")
        return shape if path is None else replace(shape, mesh=replace(shape.mesh, clean=self._clean(shape, path)))

    def _file(self, shape: ShapeDraft, mesh: MeshDraft, missing: str) -> Path | None:
        try:
            file = self._packages.resolve(mesh.reference, mesh.base or self._path)
        except PackageError as error:
            is_free = missing == "missing-visual" and error.rule != "outside-workspace"
            rule = missing if is_free or error.rule == "missing-file" else error.rule
            self.findings.append(finding(rule, str(error), shape.place))
            return None
        for note in file.notes:
            if (note.rule, note.about) not in self._reported:
                self._reported.add((note.rule, note.about))
                self.findings.append(finding(note.rule, note.text, shape.place))
        return file.path

    def _clean(self, shape: ShapeDraft, path: Path) -> CleanMesh | None:
        # Reading meshes needs numpy, which is slow to import.
        from sim_action.meshes import MeshError, clean_mesh

        assert shape.mesh is not None
        scale = shape.mesh.scale or (1.0, 1.0, 1.0)
        title = f"mesh '{shape.mesh.reference}'"
        try:
            copy = clean_mesh(path, cache_folder("meshes"), scale, ENGINE_MARGIN_M)
        except MeshError as error:
            self.findings.append(finding(error.rule, f"{title}: {error}", shape.place))
            return None
        odd = [_ODD_SHAPES[copy.facts.shape]] if copy.facts.shape in _ODD_SHAPES else []
        for rule, problem in (*odd, *_odd_sizes(copy.box, scale)):
            self.findings.append(finding(rule, f"{title} {problem}", shape.place))
        return copy


def _odd_sizes(box: Box, scale: Vector3) -> Iterator[tuple[str, str]]:
    """Yield rules that the size of a mesh breaks, with the rest of the message."""
    largest = max(above - below for below, above in zip(*box, strict=True))
    if largest > MAX_PART_SIZE_M:
        yield "absurd-size", f"is {largest:.4g} m large: if it is in millimetres, write {_scale(scale, 1e-3)}"
    elif largest < _MIN_MESH_SIZE_M:
        yield "tiny-mesh", f"is only {largest:.2g} m large: if it is already in metres, write {_scale(scale, 1e3)}"


def _scale(stated: Vector3, factor: float) -> str:
    return f'scale="{" ".join(f"{part * factor:.6g}" for part in stated)}"'
