"""Report parts of SDF and of <gazebo> tags that would change the motion of a robot but are not simulated.

Names and defaults are those of sdformat.org/spec. A part with its default value is not reported. Parameters of an
engine's solver are not in the table. Gazebo copies unknown elements of a <gazebo> tag in URDF into its SDF, so the
parts of SDF count there as well (classic.gazebosim.org, "URDF in Gazebo").
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Final, NamedTuple, Self
from xml.etree.ElementTree import Element

from sim_action.core.geometry import ZERO
from sim_action.core.wording import FirstFew, did_you_mean
from sim_action.robot.audit.elements import MAX_IGNORED_RESTITUTION, misspelled, no_bounce
from sim_action.robot.documents.sdf_elements import Notes, SdfProblem, flag_of, needed, number_of, numbers_of, text_of
from sim_action.robot.documents.urdf_elements import NUMBERS, SPRING, flag, is_expression, is_numbers, number_text
from sim_action.robot.documents.xml_document import ModelDocument
from sim_action.robot.model.findings import Finding

Default = bool | float | tuple[float, ...] | None
"""The value that has no effect; None: the presence of the part has an effect."""

PARTS: Final[Mapping[str, Mapping[str, Default]]] = MappingProxyType(
    {
        "model": {"self_collide": False, "enable_wind": False, "gripper": None},
        "link": {
            "gravity": True,
            "kinematic": False,
            "self_collide": False,
            "enable_wind": False,
            "velocity_decay/linear": 0.0,
            "velocity_decay/angular": 0.0,
            "inertial/fluid_added_mass": None,
        },
        "collision": {
            "surface/friction/torsional/coefficient": 0.0,
            "surface/friction/ode/slip1": 0.0,
            "surface/friction/ode/slip2": 0.0,
            "surface/friction/ode/fdir1": ZERO,
            "surface/friction/bullet/rolling_friction": 0.0,
            "surface/soft_contact": None,
        },
        "axis": {
            "limit/stiffness": 1e8,
            "limit/dissipation": 1.0,
        },
    }
)
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


def note_parts(notes: Notes, holder: Element, owner: str) -> None:
    """Add a finding for each unsupported part of a <model>, <link>, <collision>, <axis> or <axis2>. Raises SdfProblem.

    :param owner: the name of the element in messages.
    """
    for path, default in PARTS[holder.tag.removesuffix("2")].items():
        part = holder.find(path)
        if part is not None and _has_effect(holder, path, default):
            note_part(notes, f"{holder.tag}/{path}", part, (part.text or "").strip(), owner)


def note_part(notes: Notes, kind: str, part: Element, text: str, owner: str) -> None:
    """Note a part with this text that is not simulated; `kind`: see `Notes.leave_out`."""
    stated = f"<{part.tag}>{text}</{part.tag}>" if text else f"<{part.tag}>"
    notes.leave_out(kind, part, f"{stated} of {owner}")


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
        note_part(notes, "bullet", bullet, (bullet.text or "").strip(), owner)
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


def _has_effect(holder: Element, path: str, default: Default) -> bool:
    if default is None:
        return True
    if isinstance(default, bool):
        return flag_of(holder, path) != default
    if isinstance(default, float):
        return number_of(holder, path, default) != default
    return numbers_of(needed(holder, path), len(default)) != default


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


ALL_CONTACTS: Final = ContactBits()
"""The bits of the ground, and of shapes that state none."""


def _mask(contact: Element, tag: str, otherwise: int) -> int:
    text = text_of(contact, tag)
    if not text:
        return otherwise
    try:
        return int(text, 16 if text.lower().startswith("0x") else 10)
    except ValueError:
        raise SdfProblem("bad-number", contact, f"<{tag}> is {text[:40]!r}: expected an integer") from None


_UNSUPPORTED: Final[Mapping[str, Mapping[str, Default]]] = MappingProxyType(
    {
        "model": {**PARTS["model"], "link": None, "joint": None, "model": None, "include": None},
        "link": {
            **PARTS["link"],
            "turnGravityOff": False,
            "dampingFactor": 0.0,
            "maxVel": 0.01,
            "fdir1": (0.0, 0.0, 0.0),
            "selfCollide": False,
        },
        "joint": {},
    }
)
"""Owner of a <gazebo> tag -> path of a part -> the value that has no effect."""

_OTHERS: Final = (
    *("material", "visual", "collision", "surface", "laserRetro", "inertial", "pose", "light", "projector", "battery"),
    *("sensor", "plugin", "static", "minDepth", "maxContacts", "stopCfm", "stopErp", "stopKp", "stopKd", "fudgeFactor"),
    *("provideFeedback", "implicitSpringDamper", "cfmDamping", "disableFixedJointLumping", "preserveFixedJoint"),
    *("velocity_decay", "particle_emitter", "audio_source", "audio_sink", "physics", "axis", "frame"),
)
"""Known parts with a meaning of their own, or none for the motion."""

_KNOWN: Final = {
    "gazebo": (
        *NUMBERS,
        *SPRING,
        *dict.fromkeys(path for parts in _UNSUPPORTED.values() for path in parts if "/" not in path),
        *_OTHERS,
    )
}


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


def misspelled_parts(document: ModelDocument) -> Iterator[Finding]:
    """Yield unknown elements in <gazebo> whose name is close to a known one."""
    yield from misspelled(document, _KNOWN)


def unsupported_tags(document: ModelDocument) -> Iterator[Finding]:
    """Yield a note for each kind of parts that would change the motion but are not simulated."""
    notes = Notes()
    joints = {joint.attrib["name"] for joint in document.elements("joint")}
    links = {link.attrib["name"] for link in document.elements("link")}
    for tag in document.elements("gazebo"):
        name = tag.get("reference")
        if name is not None and name not in joints | links:
            continue
        kind = "model" if name is None else "link" if name in links else "joint"
        owner = "the model" if name is None else f"{kind} '{name}'"
        for path, default in _UNSUPPORTED[kind].items():
            part = tag.find(path)
            if part is not None and _tag_has_effect(text := number_text(tag, path) or "", default):
                note_part(notes, f"{kind}/{path}", part, text, owner)
        note_sensors(notes, tag, owner)
        for plugin in tag.findall("plugin"):
            note_plugin(notes, plugin)
    notes.places = {part: document.places[part] for part in notes.left_out}
    notes.report_parts()
    yield from notes.findings


def _tag_has_effect(text: str, default: Default) -> bool:
    if default is None:
        return True
    if isinstance(default, bool):
        return flag(text) != default
    expected = default if isinstance(default, tuple) else (default,)
    return not is_numbers(text, len(expected)) or tuple(map(float, text.split())) != expected
