"""Check elements and attributes (wiki.ros.org/urdf/XML): missing, repeated, not numbers, not read, or unsupported.

Gazebo copies unknown elements of a <gazebo> tag in URDF into its SDF, so the parts of SDF count there as well
(classic.gazebosim.org, "URDF in Gazebo").
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator
from typing import Final, NamedTuple, Self
from xml.etree.ElementTree import Element

from sim_action.core.wording import FirstFew, did_you_mean
from sim_action.robot.documents.part_table import ALL, PartTable, Unread, part_table
from sim_action.robot.documents.sdf_elements import Notes, SdfProblem, flag_of, number_of, text_of
from sim_action.robot.documents.urdf_elements import (
    CONTACT,
    MAX_NUMBER,
    NUMBERS,
    SPRING,
    is_expression,
    is_numbers,
    number_text,
)
from sim_action.robot.documents.xml_document import ModelDocument
from sim_action.robot.model.draft import SHAPES
from sim_action.robot.model.findings import Finding
from sim_action.robot.model.robot_model import MOMENTS

_REQUIRED: Final = {
    "link": ("name",),
    "joint": ("name", "type"),
    "joint/parent": ("link",),
    "joint/child": ("link",),
    "joint/mimic": ("joint",),
    "link/inertial/mass": ("value",),
    "link/inertial/inertia": MOMENTS,
    **{f"link/collision/geometry/{tag}": names for tag, names in SHAPES.items()},
    "link/collision/geometry/mesh": ("filename",),
    "link/visual/geometry/mesh": ("filename",),
}
_CHILDREN: Final = {"joint": ("parent", "child"), "link/collision": ("geometry",), "link/inertial": ("mass", "inertia")}
_MAX_SHOWN_CHARS: Final = 100
_LIMIT: Final = {"lower": 1, "upper": 1, "effort": 1, "velocity": 1}
_DYNAMICS: Final = {"damping": 1, "friction": 1, "spring_stiffness": 1, "spring_reference": 1}

_NUMBERS: Final = {
    "link/inertial/origin": {"xyz": 3, "rpy": 3},
    "link/inertial/mass": {"value": 1},
    "link/inertial/inertia": dict.fromkeys(MOMENTS, 1),
    "link/collision/origin": {"xyz": 3, "rpy": 3},
    "link/visual/origin": {"xyz": 3, "rpy": 3},
    "link/collision/geometry/box": {"size": 3},
    "link/collision/geometry/sphere": {"radius": 1},
    "link/collision/geometry/cylinder": {"radius": 1, "length": 1},
    "link/collision/geometry/capsule": {"radius": 1, "length": 1},
    "link/collision/geometry/mesh": {"scale": 3},
    "link/visual/geometry/mesh": {"scale": 3},
    "joint/origin": {"xyz": 3, "rpy": 3},
    "joint/axis": {"xyz": 3},
    "joint/axis2": {"xyz": 3},
    "joint/limit": _LIMIT,
    "joint/limit2": _LIMIT,
    "joint/dynamics": _DYNAMICS,
    "joint/dynamics2": _DYNAMICS,
    "joint/mimic": {"multiplier": 1, "offset": 1},
    "link/contact/inertia_scaling": {"value": 1},
    **{f"link/contact/{tag}": {"value": 1} for tag in CONTACT},
}
"""Path -> attribute -> the count of numbers that it must hold."""

_NOT_NEGATIVE: Final = {
    **dict.fromkeys(("dynamics", "dynamics2"), ("damping", "friction", "spring_stiffness")),
    **dict.fromkeys(CONTACT, ("value",)),
}
"""Tag -> attributes that must not be negative, because a negative value would add energy."""

# With a contact/inertia_scaling of 0, Bullet makes a body that no torque can turn.
_ABOVE_ZERO: Final = ("inertia_scaling",)

_HINTS: Final = {
    "mujoco": "; it is MJCF, which only MuJoCo reads: rename the file to end in .xml",
    "gazebo": "; it is older than SDF 1.3: convert it with 'gz sdf -p'",
}
"""Root element of another format -> the next step."""

_OPTENV: Final = re.compile(r"\$\(optenv\s+\w+\s*([^()]*)\)")
_LIKENESS: Final = 0.75
_MAX_TAG_CHARS: Final = 30


def root(document: ModelDocument) -> Iterator[Finding]:
    """Yield a finding if the file is not a URDF."""
    root = document.root
    if root.tag != "robot":
        message = f"the root element of a URDF is <robot>, but this file has <{root.tag}>"
        yield document.finding("not-a-robot", root, message + _HINTS.get(root.tag, ""))


def required_attributes(document: ModelDocument) -> Iterator[Finding]:
    """Yield elements without a required attribute."""
    for path, names in _REQUIRED.items():
        for element in document.elements(path):
            for name in names:
                if not element.get(name):
                    yield document.finding("missing-part", element, f"<{element.tag}> has no attribute '{name}'")


def required_children(document: ModelDocument) -> Iterator[Finding]:
    """Yield elements without a required child element."""
    for path, tags in _CHILDREN.items():
        for element in document.elements(path):
            for tag in tags:
                if element.find(tag) is None:
                    yield document.finding("missing-part", element, f"<{element.tag}> has no <{tag}>")
    for collision in document.elements("link/collision"):
        geometry = collision.find("geometry")
        if geometry is not None and len(geometry) == 0:
            yield document.finding("missing-part", collision, "<geometry> has no shape")


def numbers(document: ModelDocument) -> Iterator[Finding]:
    """Yield attributes that do not hold the required count of finite numbers, or a number out of range."""
    # Only the first shape of a <geometry> is read.
    unread = {shape for geometry in document.root.iter("geometry") for shape in geometry[1:]}
    for path, counts in _NUMBERS.items():
        for element in document.elements(path):
            if element in unread:
                continue
            for name, count in counts.items():
                yield from _not_numbers(document, element, path, name, count, required=name in _REQUIRED.get(path, ()))


def _not_numbers(
    document: ModelDocument, element: Element, path: str, name: str, count: int, *, required: bool
) -> Iterator[Finding]:
    text = element.get(name)
    if text is None:
        return
    shown = text if len(text) <= _MAX_SHOWN_CHARS else f"{text[:_MAX_SHOWN_CHARS]}..."
    message = f'<{element.tag} {name}="{shown}">: expected {_required_form(text, count)}'
    if is_expression(text):
        message += "; this is a xacro expression: expand the file, or use the .xacro file as the model"
    if is_expression(text) and not required:
        # A wrong place of a visual does not change the motion.
        rule = "passed-over" if path.startswith("link/visual") else "unexpanded-expression"
        yield document.finding(rule, element, message)
    elif not is_numbers(text, count):
        yield document.finding("bad-number", element, message)
    elif count == 1 and (due := _due(element.tag, name, float(text))) is not None:
        message = f'<{element.tag} {name}="{text}">: expected a number {due}'
        yield document.finding("bad-number", element, message)


def _due(tag: str, name: str, value: float) -> str | None:
    if tag in _ABOVE_ZERO and value <= 0:
        return "above 0"
    return "of 0 or more" if name in _NOT_NEGATIVE.get(tag, ()) and value < 0 else None


def _required_form(text: str, count: int) -> str:
    """Return the required form of a value, and the first difference from it."""
    if count == 1:
        return f"a finite number of at most {MAX_NUMBER:g}" if _is_large(text) else "a finite number"
    form, words = f"{count} finite numbers", text.split()
    if "," in text:
        return f"{form}, separated by spaces, not commas"
    if len(words) != count:
        return f"{form}, found {len(words)}"
    return f"{form} of at most {MAX_NUMBER:g}" if any(map(_is_large, words)) else form


def _is_large(word: str) -> bool:
    try:
        return word[-1:].isdigit() and abs(float(word)) > MAX_NUMBER
    except ValueError:
        return False


def nearest_tag(tag: str, tags: tuple[str, ...]) -> str | None:
    """Return the closest name, of several equally close ones the first; None if none is close."""
    if len(tag) > _MAX_TAG_CHARS or not tags:
        return None
    by_letters = {name.lower(): name for name in tags}
    matches = difflib.get_close_matches(tag.lower(), by_letters, n=len(tags), cutoff=_LIKENESS)
    # The order of equally close matches is reversed.
    best = [name for name in matches if _likeness(name, tag) == _likeness(matches[0], tag)]
    return by_letters[min(best, key=list(by_letters).index)] if best else None


def _likeness(name: str, tag: str) -> float:
    return difflib.SequenceMatcher(None, name, tag.lower()).ratio()


def repeated_inertials(document: ModelDocument) -> Iterator[Finding]:
    """Yield every <inertial> of a link after the first."""
    for link in document.elements("link"):
        for inertial in link.findall("inertial")[1:]:
            message = (
                f"link '{link.attrib['name']}' has a second <inertial>, which is ignored; combine both, or remove it"
            )
            yield document.finding("second-inertial", inertial, message)


def default_expressions(document: ModelDocument) -> Iterator[Finding]:
    """Replace each $(optenv NAME DEFAULT) by its default, as xacro does without such a variable, and yield a note."""
    for element in document.root.iter():
        for name, text in element.attrib.items():
            if "$(optenv " in text:
                element.set(name, _OPTENV.sub(r"\1", text))
                message = (
                    f'<{element.tag} {name}="{text[:_MAX_SHOWN_CHARS]}">: "{element.get(name)}" is used, the default'
                )
                yield document.finding("default-expression", element, message)


def restitutions(document: ModelDocument) -> Iterator[Finding]:
    """Yield restitutions above 0 in Bullet's <contact>, and anywhere in <gazebo>. Nothing bounces in the simulation."""
    for part in document.elements("link/contact/restitution", "link/collision/contact/restitution"):
        yield from _bounce(document, part, part.get("value", ""))
    for tag in document.elements("gazebo"):
        for part in tag.iter("restitution_coefficient"):
            yield from _bounce(document, part, part.get("value", part.text or "").strip())


def _bounce(document: ModelDocument, part: Element, text: str) -> Iterator[Finding]:
    if is_numbers(text, 1) and float(text) > MAX_IGNORED_RESTITUTION:
        yield document.finding("restitution", part, no_bounce(f"<{part.tag}> is {float(text):g}"))


MAX_IGNORED_RESTITUTION: Final = 0.1
"""A contact with at most this restitution loses 99 % of its energy: that nothing bounces is not reported."""


def no_bounce(statement: str, remedy: str = "set it to 0") -> str:
    """Return the message of the rule `restitution`; `statement`: the value and its place; `remedy`: the change."""
    return f"{statement}, but nothing bounces in the simulation: {remedy}, or ignore it by robot.allow"


_FORCES: Final = re.compile(
    r"buoyan|hydrodynamic|lift_?drag|thruster|(motor|multicopter)_?(motor_?)?model|wind|surface_?(float|wave)|suction|"
    r"magnet|vacuum|ros_force\b|link_?wrench",
    re.IGNORECASE,
)
"""Words in the names of plugins that push or hold links."""

_FRICTION: Final = "surface/friction"
_BOUNCE: Final = "surface/bounce/restitution_coefficient"
_CONTACT: Final = "surface/contact"
_ALL_BITS: Final = 0xFFFF
_MAX_COMPARED: Final = 100  # each unknown name is compared with all known ones

_APART: Final = frozenset({"model", "include", "link", "joint", "collision"})
"""Elements of SDF that are noted with a name of their own."""


def note_parts(notes: Notes, holder: Element, owner: str, apart: frozenset[str] = frozenset()) -> None:
    """Note each unread part of an element of SDF, without `apart`, links, joints, collisions and models in it."""
    table = part_table("sdf")
    for part in table.unread(holder, table.place("", holder.tag), _APART | apart):
        _note_unread(notes, part, owner, table)


def _note_unread(notes: Notes, part: Unread, owner: str, table: PartTable) -> None:
    """Note a part that is not read; an unknown element may be a misspelled one."""
    kind = part.place, part.name
    is_unknown = part.row is None and not part.name.startswith("@")
    if is_unknown and kind not in notes.nearest and len(notes.nearest) < _MAX_COMPARED:
        tags = (name for name in table.places.get(part.place, ()) if name != ALL and not name.startswith("@"))
        notes.nearest[kind] = nearest_tag(part.name, tuple(tags))
    meant = notes.nearest.get(kind)
    if meant is None:
        notes.leave_unread(part, owner)
    else:
        message = f"unknown element <{part.name}> in <{_parent(part)}> is ignored; did you mean <{meant}>?"
        notes.add("unknown-tag", part.element, message)


def note_sensors(notes: Notes, holder: Element, owner: str) -> None:
    """Note the sensors of a <link> or <joint>, or of the <gazebo> of one."""
    for sensor in holder.findall("sensor"):
        stated = f"<sensor type=\"{sensor.get('type', '')}\"> '{sensor.get('name', '')}' of {owner}"
        notes.leave_out("sensor", sensor, f"{stated} (a scenario has its own 'sensors')", "unused-sensor")


def note_plugin(notes: Notes, plugin: Element) -> None:
    """Note a plugin of a model that acts on links with forces."""
    title = f"{plugin.get('name', '')} {plugin.get('filename', '')}"
    if _FORCES.search(title):
        name = plugin.get("name") or plugin.get("filename", "")
        notes.leave_out(f"plugin {plugin.get('filename')}", plugin, f"the force of plugin '{name}'")


def note_contact(notes: Notes, collision: Element, owner: str) -> None:
    """Add a finding for each unsupported contact property of a <collision>. Raises SdfProblem."""
    bullet = collision.find(f"{_FRICTION}/bullet/friction")
    if bullet is not None and number_of(collision, f"{_FRICTION}/bullet/friction", 1.0) != _friction(collision):
        notes.leave_out("bullet", bullet, f"<{bullet.tag}>{(bullet.text or '').strip()}</{bullet.tag}> of {owner}")
    bounce = collision.find(_BOUNCE)
    if bounce is not None and (restitution := number_of(collision, _BOUNCE, 0.0)) > MAX_IGNORED_RESTITUTION:
        notes.add("restitution", bounce, no_bounce(f"<{bounce.tag}> of {owner} is {restitution:g}"))
    contact = collision.find(_CONTACT)
    if contact is None:
        return
    if flag_of(contact, "collide_without_contact"):
        message = f"<collide_without_contact> of {owner} is not supported"
        notes.add("unsupported-part", contact, f"{message}: use <empty/>; if allowed, it collides like any other shape")
    if not ContactBits.of(contact).meets(ALL_CONTACTS):
        message = f"<collide_bitmask> of {owner} excludes every contact, which is not supported"
        notes.add("unsupported-part", contact, f"{message}: use <empty/>; if allowed, it collides like any other shape")


def _friction(collision: Element) -> float:
    return number_of(collision, f"{_FRICTION}/ode/mu", 1.0)


class ContactBits(NamedTuple):
    """The bits of a <contact>, which decide whether two shapes touch (sdformat.org, collision/surface/contact)."""

    collide: int = _ALL_BITS
    category: int = _ALL_BITS

    @classmethod
    def of(cls, contact: Element) -> Self:
        """Return the bits that are stated. Raises SdfProblem."""
        collide = _mask(contact, "collide_bitmask", _ALL_BITS)
        return cls(collide, _mask(contact, "category_bitmask", collide))

    def meets(self, other: ContactBits) -> bool:
        """Return True if shapes with these bits touch."""
        return bool(self.category & other.collide | other.category & self.collide)


ALL_CONTACTS: Final = ContactBits()  # the bits of the ground, and of shapes that state none


def _mask(contact: Element, tag: str, otherwise: int) -> int:
    text = text_of(contact, tag)
    if not text:
        return otherwise
    try:
        return int(text, 16 if text.lower().startswith("0x") else 10)
    except ValueError:
        raise SdfProblem("bad-number", contact, f"<{tag}> is {text[:40]!r}: expected an integer") from None


def coefficients(document: ModelDocument) -> Iterator[Finding]:
    """Yield contact coefficients in <gazebo> that are not numbers, or are negative."""
    for tag in document.elements("gazebo"):
        for name in (*NUMBERS, *SPRING):
            text = number_text(tag, name)
            if text is None:
                continue
            may_be_negative = name == "springReference"
            form = "a finite number" if may_be_negative else "a finite number of 0 or more"
            message = f"<{name}>{text}</{name}>: expected {form}"
            if is_expression(text):
                yield document.finding(
                    "unexpanded-expression", tag, f"{message}; this is a xacro expression: expand the file"
                )
            elif not is_numbers(text, 1) or (float(text) < 0 and not may_be_negative):
                yield document.finding("bad-number", tag, message)


def references(document: ModelDocument) -> Iterator[Finding]:
    """Yield <gazebo> tags that refer to an unknown link or joint."""
    names = {element.attrib["name"] for element in document.elements("link", "joint")}
    hinted = FirstFew()
    for tag in document.elements("gazebo"):
        name = tag.get("reference")
        if name is not None and name not in names:
            hint = did_you_mean(name, names) if hinted.one_more() else ""
            message = f'<gazebo reference="{name}">: no link or joint has this name{hint}'
            yield document.finding("unknown-reference", tag, message)


def frictions(document: ModelDocument) -> Iterator[Finding]:
    """Yield links whose friction depends on the direction. The engines have one coefficient for all directions."""
    for tag in document.elements("gazebo"):
        mu1, mu2 = (number_text(tag, name) for name in ("mu1", "mu2"))
        if mu1 and mu2 and not is_expression(mu1 + mu2) and float(mu1) != float(mu2):
            yield document.finding("two-frictions", tag, no_direction("mu1", mu1, "mu2", mu2))


def no_direction(first: str, used: str, second: str, unused: str) -> str:
    """Return the message of the rule `two-frictions`, with the names and values of both coefficients."""
    return (
        f"{first} is {used} and {second} is {unused}, but friction cannot depend on the direction: {first} is used "
        "for both"
    )


def unread_parts(document: ModelDocument) -> Iterator[Finding]:
    """Yield a note for each kind of parts that are not read: lost, harmless or unknown."""
    notes = Notes(places=dict(document.places))
    for holder in (document.root, *document.elements("link", "joint")):
        owner = "the model" if holder is document.root else f"{holder.tag} '{holder.get('name', '')}'"
        apart = ("link", "joint", "gazebo", "sensor") if holder is document.root else ("sensor",)
        for part in part_table("urdf").unread(holder, holder.tag, apart):
            _note_unread(notes, part, owner, part_table("urdf"))
        note_sensors(notes, holder, owner)
    joints = {joint.attrib["name"] for joint in document.elements("joint")}
    links = {link.attrib["name"] for link in document.elements("link")}
    for tag in document.elements("gazebo"):
        name = tag.get("reference")
        if name is None or name in joints | links:
            _note_tag(notes, tag, "model" if name is None else "link" if name in links else "joint")
    notes.report_parts()
    yield from notes.findings


def unread_parts_of_srdf(document: ModelDocument) -> Iterator[Finding]:
    """Yield a note for each kind of parts of an SRDF that are not read."""
    notes = Notes(places=dict(document.places))
    table = part_table("srdf")
    for part in table.unread(document.root, "robot"):
        _note_unread(notes, part, "the SRDF", table)
    notes.report_parts()
    yield from notes.findings


def _note_tag(notes: Notes, tag: Element, kind: str) -> None:
    """Note the parts of a <gazebo> tag that are not read; `kind`: "model", "link" or "joint", which the tag extends."""
    owner = "the model" if kind == "model" else f"{kind} '{tag.get('reference')}'"
    urdf, sdf = part_table("urdf"), part_table("sdf")
    for part in urdf.unread(tag, f"gazebo/{kind}", tuple(child.tag for child in tag)):
        _note_unread(notes, part, owner, urdf)
    for child in tag:
        # The inside of other parts is not read, or belongs to a plugin.
        if child.tag in ("collision", "velocity_decay", "physics"):
            for part in sdf.unread(child, sdf.place(kind, child.tag)):
                _note_unread(notes, part, owner, sdf)
    note_sensors(notes, tag, owner)
    for plugin in tag.findall("plugin"):
        note_plugin(notes, plugin)


def _parent(part: Unread) -> str:
    parent, _, tag = part.place.rpartition("/")
    return parent if parent == "gazebo" else tag
