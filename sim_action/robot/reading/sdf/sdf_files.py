"""Read SDF files and find the <model> in each, within limits on the size of the whole model.

The input is not trusted, and is read in the caller's process.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core.records import dataclass
from sim_action.core.wording import shown
from sim_action.robot.documents.model_files import Version, parsed_version
from sim_action.robot.documents.xml_document import MAX_BYTES, MAX_ELEMENTS, ModelDocument, read_document
from sim_action.robot.model.findings import refuse_errors
from sim_action.robot.reading.sdf.old_versions import upgraded

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
        refuse_errors([document.finding("not-a-robot", root, message + hint)])
    version = sdf_version(document)
    document = upgraded(document, version)
    return SdfFile(path, version, _only_model(document), document)


def sdf_version(document: ModelDocument) -> Version:
    """Return the version that a document states. Raises ModelError if it is missing or not supported."""
    stated = document.root.get("version")
    if stated is None:
        problem = document.finding("missing-part", document.root, "<sdf> has no attribute 'version'")
        refuse_errors([problem])
    version = parsed_version(stated or "")
    if version < _OLDEST_VERSION:
        message = f"SDF {shown(stated)} is not supported; versions 1.3 to 1.11 are: convert it with 'gz sdf -p'"
        refuse_errors([document.finding("not-a-robot", document.root, message)])
    return version


def _only_model(document: ModelDocument) -> Element:
    root = document.root
    models, world = root.findall("model"), root.find("world")
    if world is not None:
        names = ", ".join(f"'{model.get('name', '')}'" for model in world.findall("model")) or "none"
        message = f"this SDF describes a world with the models {names}; name file and robot in the section world"
        refuse_errors([document.finding("not-a-robot", world, f"{message}: world: {{file: ..., robot: NAME}}")])
    if not models:
        refuse_errors([document.finding("not-a-robot", root, "this SDF has no <model>; one is required")])
    if len(models) > 1:
        names = ", ".join(f"'{model.get('name', '')}'" for model in models)
        message = f"this SDF has {len(models)} models: {names}; a robot must be one model, which may contain others"
        refuse_errors([document.finding("not-a-robot", models[1], message)])
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
