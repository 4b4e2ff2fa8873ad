"""Bring files of SDF below version 1.7 to the meaning of version 1.7, as libsdformat converts them.

libsdformat renames the parts that changed and then reads the file by the newest specification. So an attribute of a
newer version, such as `expressed_in` or `relative_to`, also counts in an older file. The changes (sdformat.org/spec):

- up to 1.4, an axis is in the frame of the joint's model; 1.5 and 1.6 have <use_parent_model_frame> for that; since 1.7
  it is <xyz expressed_in="__model__">. The flag comes before `expressed_in`.
- `frame` of a <pose> is called `relative_to` since 1.7.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

from sim_action.core.records import replace
from sim_action.robot.documents.model_files import Version
from sim_action.robot.documents.sdf_elements import MODEL_FRAME
from sim_action.robot.documents.xml_document import ModelDocument

PARENT_MODEL_FLAG: Final = "use_parent_model_frame"
"""An element of <axis> in SDF 1.5 and 1.6."""

FRAMES_NAMED: Final[Version] = (1, 7)
"""From this version on, `relative_to` and `expressed_in` name frames."""

_AXES_IN_MODEL_FRAME: Final[Version] = (1, 4)
_TRUE: Final = frozenset({"true", "1"})


def upgraded(document: ModelDocument, version: Version) -> ModelDocument:
    """Return a document of any version with the meaning of SDF 1.7 or newer. It changes elements in place."""
    if version >= FRAMES_NAMED:
        return document
    _rename_frames(document.root)
    added = dict(_express_axes(document.root, version))
    places = {element: document.places[axis] for element, axis in added.items()}
    return replace(document, places={**document.places, **places}) if places else document


def _rename_frames(root: Element) -> None:
    """Copy `frame` of each <pose> to `relative_to`. A name that exists nowhere is left: Gazebo ignored it."""
    names = {MODEL_FRAME, "world", *(element.get("name") for element in root.iter())}
    names |= {(name.text or "").strip() for name in root.iterfind(".//include/name")}
    # The name of a model that is included without one is in its own file.
    is_any = any(include.find("name") is None for include in root.iter("include"))
    for pose in root.iter("pose"):
        frame = pose.get("frame")
        if frame and (is_any or frame.partition("::")[0] in names):
            pose.set("relative_to", frame)


def _express_axes(root: Element, version: Version) -> Iterator[tuple[Element, Element]]:
    """Set `expressed_in` of axes in the frame of their model. Yield each <xyz> that is added, with its <axis>."""
    for joint in root.iter("joint"):
        for axis in (*joint.findall("axis"), *joint.findall("axis2")):
            flag = axis.find(PARENT_MODEL_FLAG)
            stated = version <= _AXES_IN_MODEL_FRAME if flag is None else _is_true(flag)
            if not stated:
                continue
            xyz = axis.find("xyz")
            if xyz is None:
                xyz = ET.SubElement(axis, "xyz")
                xyz.text = "0 0 1"
                yield xyz, axis
            xyz.set("expressed_in", MODEL_FRAME)


def _is_true(flag: Element) -> bool:
    return (flag.text or "").strip().lower() in _TRUE
