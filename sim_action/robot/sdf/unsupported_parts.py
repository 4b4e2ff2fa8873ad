"""Parts of SDF that change how a robot moves, and that are not simulated: a table of where each would stand.

Names and usual values are those of sdformat.org/spec. What changes nothing is not told, and what an engine's solver is
tuned with is left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.robot.sdf.elements import Notes, SdfProblem, flag_of, number_of, text_of

Usual = bool | float | None
"""What it is where it changes nothing; None: that it is there at all is odd."""

_PARTS: Final[Mapping[str, Mapping[str, Usual]]] = MappingProxyType(
    {
        "model": {"self_collide": False, "enable_wind": False},
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
            "surface/bounce/restitution_coefficient": 0.0,
            "surface/friction/torsional/coefficient": 0.0,
            "surface/friction/ode/slip1": 0.0,
            "surface/friction/ode/slip2": 0.0,
            "surface/friction/bullet/rolling_friction": 0.0,
            "surface/soft_contact": None,
        },
        "axis": {
            "limit/stiffness": 1e8,
            "limit/dissipation": 1.0,
            "dynamics/spring_stiffness": 0.0,
            "dynamics/spring_reference": 0.0,
        },
    }
)
_FRICTION: Final = "surface/friction"
_CONTACT: Final = "surface/contact"
# What the ground and all objects are to a mask: they state none.
_EVERYTHING: Final = 0xFFFF


def tell_parts(notes: Notes, holder: Element, owner: str) -> None:
    """Notes what a <model>, <link>, <collision> or <axis> has of the table; `owner`: what it is, for a message.

    Raises SdfProblem.
    """
    for path, usual in _PARTS[holder.tag].items():
        part = holder.find(path)
        if part is not None and _is_odd(holder, path, usual):
            _tell(notes, part, owner)


def tell_contact(notes: Notes, collision: Element, owner: str) -> None:
    """Notes what else a <collision> would do. Raises SdfProblem."""
    bullet = collision.find(f"{_FRICTION}/bullet/friction")
    if bullet is not None and number_of(collision, f"{_FRICTION}/bullet/friction", 1.0) != _friction(collision):
        _tell(notes, bullet, owner)
    contact = collision.find(_CONTACT)
    if contact is None:
        return
    if flag_of(contact, "collide_without_contact"):
        message = f"<collide_without_contact> of {owner} would make it a sensor that nothing bounces off"
        notes.tell("unsupported-part", contact, f"{message}: use <empty/>; let go, it collides as any other")
    own = _mask(contact, "collide_bitmask", _EVERYTHING)
    if not (own | _mask(contact, "category_bitmask", own)) & _EVERYTHING:
        message = f"<collide_bitmask> of {owner} lets it touch nothing"
        notes.tell("unsupported-part", contact, f"{message}: use <empty/>; let go, it collides as any other")


def _friction(collision: Element) -> float:
    return number_of(collision, f"{_FRICTION}/ode/mu", 1.0)


def _is_odd(holder: Element, path: str, usual: Usual) -> bool:
    if usual is None:
        return True
    return flag_of(holder, path) != usual if isinstance(usual, bool) else number_of(holder, path, usual) != usual


def _tell(notes: Notes, part: Element, owner: str) -> None:
    text = (part.text or "").strip()
    stated = f"<{part.tag}>{text}</{part.tag}>" if text else f"<{part.tag}>"
    notes.tell("passed-over", part, f"{stated} of {owner} is passed over: it is simulated as if that was not said")


def _mask(contact: Element, tag: str, otherwise: int) -> int:
    text = text_of(contact, tag)
    if not text:
        return otherwise
    try:
        return int(text, 16 if text.lower().startswith("0x") else 10)
    except ValueError:
        raise SdfProblem("bad-number", contact, f"<{tag}> is {text[:40]!r}: expected a whole number") from None
