"""The table of the tags of Gazebo worlds: those that are read, those without an effect, and those that are lost.

Names are those of sdformat.org/spec. A tag that is not in the table is lost as well.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Final, Literal
from xml.etree.ElementTree import Element

from sim_action.core.records import dataclass

Effect = Literal["read", "none", "lost"]


@dataclass(frozen=True, slots=True)
class Row:
    """One row of a table of tags.

    Attributes:
        effect: "read": it is simulated; "none": it changes nothing; "lost": it changes something in Gazebo only.
        reason: of "none" and "lost".
        neutral: texts with which a lost tag has no effect in Gazebo either.
        moving: True if it is lost only in a model that moves.
    """

    effect: Effect
    reason: str = ""
    neutral: tuple[str, ...] = ()
    moving: bool = False

    def is_lost(self, text: str, *, moves: bool) -> bool:
        """Return True if a tag with this text is lost."""
        if self.effect != "lost" or (self.moving and not moves):
            return False
        return not any(_is_equal(text, neutral) for neutral in self.neutral)


READ: Final = Row("read")
_DRAWN: Final = Row("none", "it is only drawn")
_SOLVER: Final = Row("none", "it is a parameter of Gazebo's engine")
_PLUGINS: Final = Row("none", "only plugins use it, and they are reported")

_SOUND: Final = Row("none", "there is no sound")
_CLOCK: Final = Row("none", "the clock starts at 0")
_WIND: Final = Row("lost", "there is no wind", ("false",), moving=True)
_SELF_COLLIDE: Final = Row("lost", "links that move as one body do not touch each other", ("false",), moving=True)
_ONE_BODY: Final = Row("lost", "the links that it joins move as one body", moving=True)
_DAMPED: Final = Row("lost", "the motion is not damped", ("0",), moving=True)
_SLIP: Final = Row("lost", "contacts do not slip", ("0",))
_TORSION: Final = Row("lost", "a contact does not resist a turn", ("0",))
_NO_RADIUS: Final = Row("none", "it acts only with a radius, which is reported")


def _rows(row: Row, tags: str) -> dict[str, Row]:
    return dict.fromkeys(tags.split(), row)


_TAGS: Final[Mapping[str, Mapping[str, Row]]] = MappingProxyType(
    {
        "world": {
            **_rows(READ, "include model gravity state plugin frame"),
            **_rows(_DRAWN, "light scene gui road"),
            **_rows(_PLUGINS, "magnetic_field spherical_coordinates atmosphere"),
            "physics": _SOLVER,
            "audio": _SOUND,
            "wind": Row("none", "a wind other than 0 is a remark; it acts only on models with <enable_wind>"),
            "actor": Row("lost", "nothing can touch or see it"),
            "population": Row("lost", "its models are missing"),
            "joint": Row("lost", "the models are not joined"),
        },
        "include": _rows(READ, "uri name pose static plugin placement_frame merge"),
        "model": {
            **_rows(READ, "static pose link model include plugin frame"),
            **_rows(_ONE_BODY, "joint gripper"),
            "allow_auto_disable": _SOLVER,
            "self_collide": _SELF_COLLIDE,
            "enable_wind": _WIND,
        },
        "link": {
            **_rows(READ, "pose inertial collision velocity_decay"),
            **_rows(_DRAWN, "visual light projector particle_emitter"),
            **_rows(_SOUND, "audio_sink audio_source"),
            "sensor": Row("none", "it is a remark; without a plugin it publishes nothing for nodes"),
            "battery": _PLUGINS,
            "must_be_base_link": _SOLVER,
            "self_collide": _SELF_COLLIDE,
            "gravity": Row("lost", "the body falls", ("true",), moving=True),
            "kinematic": Row("lost", "the body obeys forces", ("false",), moving=True),
            "enable_wind": _WIND,
        },
        "velocity_decay": _rows(_DAMPED, "linear angular"),
        "collision": {
            **_rows(READ, "pose geometry surface"),
            "max_contacts": _SOLVER,
            "laser_retro": Row("lost", "lidars measure no intensity", ("0",)),
        },
        "surface": {
            **_rows(READ, "friction bounce contact"),
            "soft_contact": Row("lost", "contacts are hard"),
        },
        "friction": {
            **_rows(READ, "ode torsional"),
            "bullet": Row("none", "Gazebo's default engine reads the tags of <ode>"),
        },
        "ode": {
            **_rows(READ, "mu mu2"),
            **_rows(_SLIP, "slip1 slip2"),
            "fdir1": Row("none", "it matters only if <mu> and <mu2> differ, which is reported"),
        },
        "torsional": {
            **_rows(_NO_RADIUS, "coefficient use_patch_radius ode"),
            **_rows(_TORSION, "patch_radius surface_radius"),
        },
        "bounce": {
            "restitution_coefficient": Row("lost", "nothing bounces", ("0",)),
            "threshold": Row("none", "it acts only with a restitution, which is reported"),
        },
        "contact": {
            **_rows(_SOLVER, "ode bullet poissons_ratio elastic_modulus"),
            # BodyReader compares them.
            **_rows(READ, "collide_bitmask category_bitmask"),
            "collide_without_contact": Row("lost", "it collides like any other shape", ("false",)),
            "collide_without_contact_bitmask": Row("none", "it acts only with <collide_without_contact>"),
        },
        "mesh": {
            **_rows(READ, "uri scale"),
            "submesh": Row("lost", "the shape cannot be a part of a file"),
        },
        "state": {
            **_rows(_CLOCK, "sim_time real_time wall_time iterations"),
            "model": READ,
            "light": _DRAWN,
            "insertions": Row("lost", "its models are missing"),
            "deletions": Row("lost", "its models still exist"),
        },
        "state/model": {
            **_rows(READ, "pose link"),
            "scale": Row("lost", "the model has its own size", ("1 1 1",)),
            "joint": Row("lost", "joints start at home"),
            "model": Row("lost", "the nested model is at the pose of its own file"),
        },
        "state/link": {
            "pose": READ,
            "velocity": Row("lost", "the link starts at rest", ("0 0 0 0 0 0",)),
            "acceleration": Row("none", "it follows from forces"),
            "wrench": Row("none", "it follows from forces and contacts"),
            "collision": Row("none", "it repeats the pose of the link"),
        },
    }
)

HARMLESS_WORLD_PLUGINS: Final[Mapping[str, str]] = {
    "gazebo_ros_api_plugin": "its services and topics are those of sim-action",
    "gazebo_ros_paths_plugin": "it sets search paths, which sim-action takes from packages",
    "gazebo_ros_init": "it starts ROS 2 in Gazebo",
    "gazebo_ros_factory": "it spawns models for nodes of ROS 2",
    **{
        f"{generation}-{system}-system": "it runs a part of Gazebo itself"
        for generation in ("gz-sim", "ignition-gazebo")
        for system in ("physics", "user-commands", "scene-broadcaster", "sensors", "imu", "contact", "log")
    },
}
"""Plugin of a world -> the reason why its absence is not a loss."""


def lost_tags(holder: Element, kind: str = "", *, moves: bool = False) -> Iterator[tuple[Element, str]]:
    """Yield each lost tag below an element, with the message about it; `kind`: its table, if not that of its tag."""
    rows = _TAGS[kind or holder.tag]
    for tag in holder:
        row = rows.get(tag.tag)
        text = (tag.text or "").strip()
        if tag.tag == "joint" and tag.get("type") == "fixed" and holder.tag != "world":
            continue
        if row is None:
            yield tag, f"<{tag.tag}> of <{holder.tag}> is not supported and has no effect"
        elif row.is_lost(text, moves=moves):
            yield tag, f"<{tag.tag}>{f'{text}</{tag.tag}>' if text else ''} is not simulated: {row.reason}"


def lost_tags_below(holder: Element, *, moves: bool) -> Iterator[tuple[Element, str]]:
    """Yield the lost tags of an element and of all tags below it that have a table."""
    yield from lost_tags(holder, moves=moves)
    rows = _TAGS[holder.tag]
    for tag in holder:
        if tag.tag in _TAGS and rows.get(tag.tag) is READ:
            yield from lost_tags_below(tag, moves=moves)


def _is_equal(text: str, neutral: str) -> bool:
    found, wanted = _numbers(text), _numbers(neutral)
    return found == wanted if found is not None and wanted is not None else text.lower() == neutral.lower()


def _numbers(text: str) -> tuple[float, ...] | None:
    words = {"true": "1", "false": "0"}
    try:
        found = tuple(float(words.get(word.lower(), word)) for word in text.split())
    except ValueError:
        return None
    return found if found and all(map(math.isfinite, found)) else None
