"""Check links: their shapes (kinds, sizes, units), masses and moments of inertia; find and clean their meshes.

Inertias must be present, physically possible, and in proportion to the size of the link.

The bounds on proportions are wide, because exporters round and shapes are simplified. A link that weighs almost
nothing compared to the model may have a placeholder inertia. No real robot in pybullet_data comes near the bounds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final
from xml.etree.ElementTree import Element

from sim_action.core import geometry
from sim_action.core.files import cache_folder
from sim_action.core.geometry import ZERO, Box, Vector3
from sim_action.core.records import dataclass
from sim_action.robot.audit.joints import is_free_base
from sim_action.robot.documents import urdf_elements
from sim_action.robot.documents.packages import PackageError, Packages
from sim_action.robot.documents.urdf_elements import MAX_PART_SIZE_M, vector
from sim_action.robot.documents.xml_document import ModelDocument
from sim_action.robot.model.findings import Finding
from sim_action.robot.model.robot_model import ENGINE_MARGIN_M, WORLD, Link, Shape

if TYPE_CHECKING:
    from sim_action.meshes import CleanMesh


# Beyond this size, a part that is this many times as large as all usual ones was probably drawn in millimetres.
_MAX_USUAL_SIZE_M: Final = 10.0
_MAX_RATIO: Final = 100.0
_TURN: Final = 6.3  # 360 deg in rad, rounded up
KINDS: Final = (*urdf_elements.SHAPES, "mesh")


def kinds(document: ModelDocument) -> Iterator[Finding]:
    """Yield shapes that URDF does not define. Only the first child of <geometry> is read."""
    for holder in document.elements("link/collision/geometry", "link/visual/geometry"):
        shape = next(iter(holder), None)
        if shape is not None and shape.tag not in KINDS:
            message = f"unknown shape <{shape.tag}>; the shapes are {', '.join(KINDS)}"
            yield document.finding("unknown-shape", shape, message)


def sizes(document: ModelDocument) -> Iterator[Finding]:
    """Yield shapes with a size that is not greater than 0."""
    for shape in _shapes(document):
        if is_empty(shape):
            message = f"<{shape.tag}> has no size, so nothing can touch it: it is ignored"
            yield document.finding("empty-shape", shape, message)
            continue
        for name, lengths in _lengths(shape).items():
            if min(lengths) <= 0:
                tag = f'<{shape.tag} {name}="{shape.attrib[name]}">'
                requirement = (
                    f"the {name} must be greater than 0" if name != "size" else "all sizes must be greater than 0"
                )
                yield document.finding("bad-shape", shape, f"{tag}: {requirement}")


def is_empty(shape: Element) -> bool:
    """Return True if all sizes of a shape are 0; a cylinder or capsule has none without a radius."""
    lengths = _lengths(shape)
    return bool(lengths) and not any(lengths.get("radius", next(iter(lengths.values()))))


def extents(document: ModelDocument) -> Iterator[Finding]:
    """Yield shapes and offsets that are too large for a robot."""
    sizes = {shape: _extent(shape) for shape in _shapes(document)}
    usual = max((size for size in sizes.values() if size <= _MAX_USUAL_SIZE_M), default=0.0)
    # A mesh can be larger than the other parts.
    is_known = usual > 0 and document.root.find("link/collision/geometry/mesh") is None
    for shape, size in sizes.items():
        if size > urdf_elements.MAX_PART_SIZE_M:
            message = f"<{shape.tag}> is {size:g} m large; models are in metres: is it in millimetres?"
            yield document.finding("absurd-size", shape, message)
        elif is_known and size > _MAX_USUAL_SIZE_M and size > _MAX_RATIO * usual:
            message = f"<{shape.tag}> is {size:g} m large, but the other parts at most {usual:g} m"
            yield document.finding("absurd-size", shape, f"{message}: is it in millimetres?")
    for element in document.elements("joint/origin", "link/collision/origin", "link/inertial/origin"):
        offset = max(map(abs, urdf_elements.vector(element, "xyz", (0.0, 0.0, 0.0))))
        if offset > urdf_elements.MAX_PART_SIZE_M:
            message = f"<origin> is {offset:g} m away; URDF is in metres: is it in millimetres?"
            yield document.finding("absurd-size", element, message)


def angles(document: ModelDocument) -> Iterator[Finding]:
    """Yield origins that are rotated by more than a full turn."""
    for element in document.elements("joint/origin", "link/collision/origin", "link/inertial/origin"):
        largest = max(map(abs, urdf_elements.vector(element, "rpy", ZERO)))
        if largest > _TURN:
            message = f"<origin> is rotated by {largest:g} rad, more than a full turn: is it in degrees?"
            yield document.finding("odd-angle", element, message)


def collisions(document: ModelDocument) -> Iterator[Finding]:
    """Yield a finding if no link has a collision shape."""
    if document.root.find("link/collision") is None:
        message = "no link has a <collision>: the robot falls through the ground"
        yield document.finding("no-collision-shape", document.root, message)


def _shapes(document: ModelDocument) -> Iterator[Element]:
    return document.elements(*(f"link/collision/geometry/{tag}" for tag in urdf_elements.SHAPES))


def _extent(shape: Element) -> float:
    return max((max(sizes) * (2 if name == "radius" else 1) for name, sizes in _lengths(shape).items()), default=0.0)


def _lengths(shape: Element) -> dict[str, tuple[float, ...]]:
    named = {name: urdf_elements.number(shape, name) for name in ("radius", "length")}
    lengths: dict[str, tuple[float, ...]] = {name: (value,) for name, value in named.items() if value is not None}
    return lengths | ({"size": urdf_elements.vector(shape, "size", (0.0, 0.0, 0.0))} if shape.tag == "box" else {})


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


def masses(document: ModelDocument) -> Iterator[Finding]:
    """Yield masses that are negative or 0."""
    bodies: RigidBodies | None = None
    for link in document.elements("link"):
        mass = link.find("inertial/mass")
        value = urdf_elements.number(mass, "value") or 0.0
        if mass is None or value > 0:
            continue
        name = link.attrib["name"]
        bodies = bodies or RigidBodies(document)
        if value < 0:
            yield document.finding("negative-mass", mass, f'<mass value="{value:g}">: a mass must not be negative')
        elif bodies.holds_mass(name):
            message = f"link '{name}' has a mass of 0, and is fixed to others that have one: it adds nothing"
            yield document.finding("massless-frame", mass, message)
        elif bodies.is_base(name):
            message = f"base link '{name}' has a mass of 0, so it is fixed; to let it move, give it a mass"
            yield document.finding("massless-base", mass, message)
        else:
            message = f"link '{name}' moves, but has a mass of 0: state the mass, or remove <inertial>"
            yield document.finding("zero-mass", mass, message)


class RigidBodies:
    """The links of a model in groups that fixed joints hold together."""

    def __init__(self, document: ModelDocument) -> None:
        held = {
            urdf_elements.child_of(joint): urdf_elements.parent_of(joint)
            for joint in document.elements("joint[@type='fixed']")
        }
        self._moved = {urdf_elements.child_of(joint) for joint in document.elements("joint")} - held.keys()
        self._first: dict[str, str] = {}
        self._masses: dict[str, float] = {}
        for link in document.elements("link"):
            first = name = link.attrib["name"]
            while first in held:
                first = held[first]
            self._first[name] = first
            mass = urdf_elements.number(link.find("inertial/mass"), "value") or 0.0
            self._masses[first] = self._masses.get(first, 0.0) + max(0.0, mass)

    def holds_mass(self, link: str) -> bool:
        """Return True if a link is fixed to one with a mass, or to the world."""
        first = self._first[link]
        return self._masses[first] > 0 or first == WORLD

    def is_base(self, link: str) -> bool:
        """Return True if a link is the base, or is fixed to it."""
        return self._first[link] not in self._moved


def tensors(document: ModelDocument) -> Iterator[Finding]:
    """Yield inertias whose principal moments are not positive, or break the triangle inequality."""
    for link in document.elements("link"):
        for inertial in link.findall("inertial"):
            if urdf_elements.number(inertial.find("mass"), "value") != 0:
                yield from _tensor(document, link.attrib["name"], inertial.find("inertia"))


def _tensor(document: ModelDocument, link: str, inertia: Element | None) -> Iterator[Finding]:
    if inertia is None:
        return
    a, b, c = sorted(principal_moments(inertia))
    moments = f"principal moments of inertia {a:.3g}, {b:.3g}, {c:.3g} kg m^2"
    if all((urdf_elements.number(inertia, name) or 0.0) == 0 for name in urdf_elements.MOMENTS):
        message = f"{moments}: the mass counts as a ball of 5 cm radius; state the moments"
        yield document.finding("zero-inertia", inertia, message)
        return
    lacking, rounding = (
        max(-a, c - a - b),
        max(_SMALL_SHARE * c, 2 * max(_last_digit(inertia.get(name, "0")) for name in urdf_elements.MOMENTS)),
    )
    if a > 0 and lacking <= _ROUNDING * (a + b):
        return
    requirement = (
        "all of them must be greater than 0" if a <= 0 else "none may be greater than the sum of the other two"
    )
    more = increase(inertia)
    used = f"{a + more:.3g}, {b + more:.3g}, {c + more:.3g} kg m^2 are used, the smallest increase that is possible"
    if lacking <= rounding:
        message = f"{moments}: {requirement}; they miss this only by rounding: {used}"
        yield document.finding("rounded-inertia", inertia, message)
    elif -a <= rounding < c:
        message = f"link '{link}' has {moments}: {requirement}; {used}; state the moments about the centre of mass"
        yield document.finding("uneven-inertia", inertia, message)
    else:
        yield document.finding("impossible-inertia", inertia, f"{moments}: {requirement}")


def increase(inertia: Element) -> float:
    """Return the smallest moment in kg m^2 that makes an inertia possible if it is added about every axis."""
    least, middle, most = sorted(principal_moments(inertia))
    lacking = most - least - middle + _REPAIRED * most
    return lacking - min(0.0, least) if lacking > 0 else 0.0


def _last_digit(text: str) -> float:
    value = Decimal(text.strip())
    exponent = value.as_tuple().exponent
    return float(Decimal(1).scaleb(exponent)) if value and isinstance(exponent, int) and exponent < 0 else 0.0


def inertials(document: ModelDocument) -> Iterator[Finding]:
    """Yield links without <inertial>, and a model in which no link has a mass."""
    joints = list(document.elements("joint"))
    is_fixed = any(link.attrib["name"] == WORLD for link in document.elements("link"))
    if is_fixed and all(joint.get("type") == "fixed" for joint in joints):
        return  # Nothing moves, so no mass has an effect.
    if not any(urdf_elements.number(mass, "value") for mass in document.elements("link/inertial/mass")):
        message = "no link of the model has a mass: each gets a negligible one, and the base must be fixed"
        yield document.finding("massless-model", document.root, message)
        return
    free_of_mass = {WORLD, *(urdf_elements.parent_of(joint) for joint in joints if is_free_base(document, joint))}
    for link in document.elements("link"):
        if link.find("inertial") is None and link.attrib["name"] not in free_of_mass:
            message = f"link '{link.attrib['name']}' has no <inertial>: it gets a negligible mass"
            yield document.finding("missing-inertia", link, message)


def principal_moments(inertia: Element) -> tuple[float, float, float]:
    """Return the principal moments in kg m^2, in rising order."""
    xx, xy, xz, yy, yz, zz = (
        urdf_elements.number(inertia, name) or 0.0 for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    return geometry.symmetric_eigenvalues((xx, yy, zz), xy, xz, yz)


def proportions(document: ModelDocument, links: Sequence[Link]) -> Iterator[Finding]:
    """Yield inertias and masses that do not fit the size of their links, which know the sizes of their meshes."""
    shaped = {link.name: link for link in links if link.collisions and link.mass}
    total = sum(link.mass or 0.0 for link in links)
    for element in document.elements("link"):
        link = shaped.get(element.attrib["name"])
        if link is not None:
            yield from _inertia(document, element, link, _NEGLIGIBLE * total)
    yield from _density(document, shaped)


def _inertia(document: ModelDocument, element: Element, link: Link, least_mass: float) -> Iterator[Finding]:
    inertial, inertia = element.find("inertial"), element.find("inertial/inertia")
    if inertial is None or inertia is None or not link.mass or link.mass < 0:
        return
    moments = principal_moments(inertia)
    centre = urdf_elements.origin(inertial).position_xyz
    reach = max(_distance(shape, centre) + _half_diagonal(shape) for shape in link.collisions)
    if min(moments) <= 0:
        return  # impossible-inertia reports it
    moment = max(moments)
    radius = math.sqrt(moment / link.mass)
    is_far = math.sqrt(moment / max(link.mass, least_mass)) > _MAX_GYRATION_RATIO * reach
    if is_far or radius < _MIN_GYRATION_RATIO * max(map(_half_diagonal, link.collisions)):
        problem = (
            f"link '{link.name}' has {moment:.3g} kg m^2 at {link.mass:.3g} kg, like a point mass at {radius:.2g} m"
        )
        message = f"{problem}, but the link extends only {reach:.2g} m from its centre of mass: is the unit kg m^2?"
        yield document.finding("odd-inertia", inertia, message)


def _distance(shape: Shape, point: Vector3) -> float:
    x, y, z = ((low + high) / 2 for low, high in zip(shape.lower_xyz, shape.upper_xyz, strict=True))
    middle = geometry.compose(shape.pose, geometry.Pose((x, y, z)))
    return math.dist(middle.position_xyz, point)


def _half_diagonal(shape: Shape) -> float:
    return math.hypot(*_sizes(shape)) / 2


def _sizes(shape: Shape) -> Iterator[float]:
    return (max(high - low, _MIN_THICKNESS_M) for low, high in zip(shape.lower_xyz, shape.upper_xyz, strict=True))


def _density(document: ModelDocument, shaped: Mapping[str, Link]) -> Iterator[Finding]:
    """Yield a finding if all shapes together are too dense; a single shape may be a placeholder."""
    mass = sum(link.mass or 0.0 for link in shaped.values())
    volume = sum(math.prod(_sizes(shape)) for link in shaped.values() for shape in link.collisions)
    if mass > _MAX_DENSITY * volume:
        heaviest = max(shaped.values(), key=lambda link: link.mass or 0.0)
        links = (link for link in document.elements("link") if link.attrib["name"] == heaviest.name)
        place = next(mass for link in links for mass in link.iterfind("inertial/mass"))
        density = f"{mass:.4g} kg in at most {volume:.2g} m^3, a density of {mass / volume:,.0f} kg/m^3"
        yield document.finding("odd-mass", place, f"{density}: are masses in grams, or sizes too small?")


# A smaller mesh consists of that margin only.
_MIN_MESH_SIZE_M: Final = 0.001
_ODD_SHAPES: Final = {
    "concave": ("concave-mesh", "is concave or open: its convex hull collides instead; split it into convex parts"),
    "flat": ("flat-mesh", "has no volume: it collides as a plate as thick as the engine's margin; give it a thickness"),
}


@dataclass(frozen=True, eq=False)
class Meshes:
    """The result of resolving the meshes of a model."""

    findings: tuple[Finding, ...]
    boxes: Mapping[Element, Box]  # the box around each collision mesh, in m, in its own frame, with its scale applied
    hulls: Mapping[Element, bytes]  # the text of each clean copy, see `Shape`
    visuals: Mapping[Element, Path]  # the file of each visual mesh


def resolve_meshes(document: ModelDocument, path: Path, packages: Packages) -> Meshes:
    """Find all meshes, and replace collision meshes by clean copies. `path`: the file of the model."""
    clean: dict[Element, CleanMesh] = {}
    visuals: dict[Element, Path] = {}
    findings = tuple(_resolve(document, path, packages, clean, visuals))
    boxes, hulls = {mesh: copy.box for mesh, copy in clean.items()}, {mesh: copy.text for mesh, copy in clean.items()}
    return Meshes(findings, MappingProxyType(boxes), MappingProxyType(hulls), MappingProxyType(visuals))


def _resolve(
    document: ModelDocument,
    path: Path,
    packages: Packages,
    clean: dict[Element, CleanMesh],
    visuals: dict[Element, Path],
) -> Iterator[Finding]:
    reported = set[tuple[str, Path]]()
    for shape in document.elements("link/collision", "link/visual"):
        mesh = shape.find("geometry/mesh")
        if mesh is None:
            continue
        try:
            file = packages.resolve(mesh.attrib["filename"], document.files.get(mesh, path))
        except PackageError as error:
            missing = "missing-mesh" if error.rule == "missing-file" else error.rule
            rule = "missing-visual" if shape.tag == "visual" and error.rule != "outside-workspace" else missing
            yield document.finding(rule, mesh, str(error))
            continue
        for note in file.notes:
            if (note.rule, note.about) not in reported:
                reported.add((note.rule, note.about))
                yield document.finding(note.rule, mesh, note.text)
        if shape.tag == "collision":
            # With this flag, the engine lets a moving body fall through the ground.
            shape.attrib.pop("concave", None)
            yield from _rewrite(document, mesh, file.path, clean)
        else:
            visuals[mesh] = file.path


def _rewrite(document: ModelDocument, mesh: Element, path: Path, clean: dict[Element, CleanMesh]) -> Iterator[Finding]:
    # Reading meshes needs numpy, which is slow to import.
    from sim_action.meshes import MeshError, clean_mesh
    from sim_action.meshes.collision_hulls import hull_file_name  # a usual run does without it

    name, scale = mesh.attrib["filename"], vector(mesh, "scale", (1.0, 1.0, 1.0))
    try:
        copy = clean_mesh(path, cache_folder("meshes"), scale, ENGINE_MARGIN_M)
    except MeshError as error:
        yield document.finding(error.rule, mesh, f"mesh '{name}': {error}")
        return
    if copy.facts.shape in _ODD_SHAPES:
        rule, what = _ODD_SHAPES[copy.facts.shape]
        yield document.finding(rule, mesh, f"mesh '{name}' {what}")
    clean[mesh] = copy
    for rule, what in _odd_sizes(copy.box, scale):
        yield document.finding(rule, mesh, f"mesh '{name}' {what}")
    mesh.attrib.clear()
    mesh.set("filename", hull_file_name(copy.text))


def _odd_sizes(box: Box, scale: Vector3) -> Iterator[tuple[str, str]]:
    """Yield rules that the size of a mesh breaks, with the rest of the message."""
    largest = max(above - below for below, above in zip(*box, strict=True))
    if largest > MAX_PART_SIZE_M:
        yield "absurd-size", f"is {largest:.4g} m large: if it is in millimetres, write {_scale(scale, 1e-3)}"
    elif largest < _MIN_MESH_SIZE_M:
        yield "tiny-mesh", f"is only {largest:.2g} m large: if it is already in metres, write {_scale(scale, 1e3)}"


def _scale(stated: Vector3, factor: float) -> str:
    return f'scale="{" ".join(f"{part * factor:.6g}" for part in stated)}"'
