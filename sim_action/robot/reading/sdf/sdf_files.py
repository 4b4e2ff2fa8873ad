"""Read SDF files and find the <model> in each, within limits on the size of the whole model.

The input is not trusted, and is read in the caller's process.

Files below version 1.7 get the meaning of version 1.7, as libsdformat converts them. It renames the parts that changed
and then reads the file by the newest specification. So an attribute of a newer version, such as `expressed_in` or
`relative_to`, also counts in an older file. The changes (sdformat.org/spec):

- up to 1.4, an axis is in the frame of the joint's model; 1.5 and 1.6 have <use_parent_model_frame> for that; since 1.7
  it is <xyz expressed_in="__model__">. The flag comes before `expressed_in`.
- `frame` of a <pose> is called `relative_to` since 1.7.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

from sim_action.core.records import dataclass, replace
from sim_action.core.wording import shown
from sim_action.robot.documents.packages import Version, parsed_version
from sim_action.robot.documents.sdf_elements import MODEL_FRAME
from sim_action.robot.documents.xml_document import MAX_BYTES, MAX_ELEMENTS, ModelDocument, read_document

_OLDEST_VERSION: Final[Version] = (1, 3)
_MAX_INCLUDES: Final = 500


@dataclass(frozen=True, eq=False)
class SdfFile:
    """A file with one <model> in it."""

    path: Path
    version: Version
    model: Element
    document: ModelDocument


def read_sdf_file(path: Path, document: ModelDocument | None = None) -> SdfFile:
    """Read a file that describes one model. Raises ModelError."""
    document = document or read_document(path)
    root = document.root
    if root.tag != "sdf":
        message = f"the root element of an SDF file is <sdf>, but this file has <{root.tag}>"
        hint = "; an SDF file can include only SDF: convert the file" if root.tag == "robot" else ""
        document.refuse("not-a-robot", root, message + hint)
    version = sdf_version(document)
    document = upgraded(document, version)
    return SdfFile(path, version, _only_model(document), document)


def sdf_version(document: ModelDocument) -> Version:
    """Return the version that a document states. Raises ModelError if it is missing or not supported."""
    stated = document.root.get("version")
    if stated is None:
        document.refuse("missing-part", document.root, "<sdf> has no attribute 'version'")
    version = parsed_version(stated)
    if version < _OLDEST_VERSION:
        message = f"SDF {shown(stated)} is not supported; versions 1.3 to 1.12 are: convert it with 'gz sdf -p'"
        document.refuse("not-a-robot", document.root, message)
    return version


def _only_model(document: ModelDocument) -> Element:
    root = document.root
    models, world = root.findall("model"), root.find("world")
    if world is not None:
        names = ", ".join(f"'{model.get('name', '')}'" for model in world.findall("model")) or "none"
        message = f"this SDF describes a world with the models {names}; name file and robot in the section world"
        document.refuse("not-a-robot", world, f"{message}: world: {{file: ..., robot: NAME}}")
    if not models:
        document.refuse("not-a-robot", root, "this SDF has no <model>; one is required")
    if len(models) > 1:
        names = ", ".join(f"'{model.get('name', '')}'" for model in models)
        message = f"this SDF has {len(models)} models: {names}; a robot must be one model, which may contain others"
        document.refuse("not-a-robot", models[1], message)
    return models[0]


class ModelTooLarge(Exception):
    """The files of a model exceed a size limit; reading stops."""


class SizeBudget:
    """Reads the files of one model, each once, and counts includes, elements and bytes."""

    def __init__(self, document: ModelDocument) -> None:
        self._read: dict[Path, ModelDocument] = {}
        self._includes = 0
        self._elements = len(document.places)
        self._bytes = document.size

    def begin_include(self) -> None:
        """Count one more include. Raises ModelTooLarge."""
        self._includes += 1
        if self._includes > _MAX_INCLUDES:
            raise ModelTooLarge(f"a model may include at most {_MAX_INCLUDES} others")

    def read(self, path: Path) -> ModelDocument:
        """Return a file, read at the first call. Raises ModelError, ModelTooLarge."""
        if path not in self._read:
            document = read_document(path)
            self.count_elements(document)
            self._bytes += document.size
            if self._bytes > MAX_BYTES:
                raise ModelTooLarge(
                    f"a model may have at most {MAX_BYTES // 1_000_000} MB, all included files together"
                )
            self._read[path] = document
        return self._read[path]

    def count_elements(self, document: ModelDocument) -> None:
        """Count the elements of a document that is used once more. Raises ModelTooLarge."""
        self._elements += len(document.places)
        if self._elements > MAX_ELEMENTS:
            raise ModelTooLarge(f"a model may have at most {MAX_ELEMENTS:,} elements, all included files together")


PARENT_MODEL_FLAG: Final = "use_parent_model_frame"  # an element of <axis> in SDF 1.5 and 1.6
FRAMES_NAMED: Final[Version] = (1, 7)  # from this version on, `relative_to` and `expressed_in` name frames
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
            stated = version <= _AXES_IN_MODEL_FRAME if flag is None else (flag.text or "").strip().lower() in _TRUE
            if not stated:
                continue
            xyz = axis.find("xyz")
            if xyz is None:
                xyz = ET.SubElement(axis, "xyz")
                xyz.text = "0 0 1"
                yield xyz, axis
            xyz.set("expressed_in", MODEL_FRAME)
