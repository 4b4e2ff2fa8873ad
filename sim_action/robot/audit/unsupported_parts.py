"""Report parts of URDF, SDF and SRDF that are not read, by the tables of `part_table`, and unsupported values.

Gazebo copies unknown elements of a <gazebo> tag in URDF into its SDF, so the parts of SDF count there as well
(classic.gazebosim.org, "URDF in Gazebo").
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final, NamedTuple, Self
from xml.etree.ElementTree import Element

from sim_action.core.wording import FirstFew, did_you_mean
from sim_action.robot.audit.elements import MAX_IGNORED_RESTITUTION, nearest_tag, no_bounce
from sim_action.robot.documents.part_table import ALL, PartTable, Unread, part_table
from sim_action.robot.documents.sdf_elements import Notes, SdfProblem, flag_of, number_of, text_of
from sim_action.robot.documents.urdf_elements import NUMBERS, SPRING, is_expression, is_numbers, number_text
from sim_action.robot.documents.xml_document import ModelDocument
from sim_action.robot.model.findings import Finding

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
        known = (name for name in table.places.get(part.place, ()) if name != ALL and not name.startswith("@"))
        notes.nearest[kind] = nearest_tag(part.name, tuple(known))
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
            wanted = "a finite number" if may_be_negative else "a finite number of 0 or more"
            message = f"<{name}>{text}</{name}>: expected {wanted}"
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
            message = (
                f"mu1 is {mu1} and mu2 is {mu2}, but friction cannot depend on the direction: mu1 is used for both"
            )
            yield document.finding("two-frictions", tag, message)


def unread_parts(document: ModelDocument) -> Iterator[Finding]:
    """Yield a note for each kind of parts that are not read: those that are lost, harmless or unknown."""
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
    notes, table = Notes(places=dict(document.places)), part_table("srdf")
    for part in table.unread(document.root, "robot"):
        _note_unread(notes, part, "the SRDF", table)
    notes.report_parts()
    yield from notes.findings


def _note_tag(notes: Notes, tag: Element, kind: str) -> None:
    """Note the parts of a <gazebo> tag that are not read; `kind`: what it is about."""
    owner = "the model" if kind == "model" else f"{kind} '{tag.get('reference')}'"
    urdf, sdf = part_table("urdf"), part_table("sdf")
    for part in urdf.unread(tag, f"gazebo/{kind}", tuple(child.tag for child in tag)):
        _note_unread(notes, part, owner, urdf)
    for child in tag:
        # The inside of other parts is not read, or is that of a plugin.
        if child.tag in ("collision", "velocity_decay", "physics"):
            for part in sdf.unread(child, sdf.place(kind, child.tag)):
                _note_unread(notes, part, owner, sdf)
    note_sensors(notes, tag, owner)
    for plugin in tag.findall("plugin"):
        note_plugin(notes, plugin)


def _parent(part: Unread) -> str:
    """Return the tag of the element around a part."""
    parent, _, tag = part.place.rpartition("/")
    return parent if parent == "gazebo" else tag
