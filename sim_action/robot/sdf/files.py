"""SDF files, and the <model> in each."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core.messages import shown
from sim_action.robot.audit.rules import refuse_errors
from sim_action.robot.packages import Version, parsed_version
from sim_action.robot.xml_document import MAX_BYTES, MAX_ELEMENTS, ModelDocument, read_document

_OLDEST: Final[Version] = (1, 4)


@dataclass(frozen=True, eq=False)
class SdfFile:
    """A file with one <model> in it."""

    path: Path
    version: Version
    model: Element
    document: ModelDocument


def read_sdf_file(path: Path, document: ModelDocument | None = None) -> SdfFile:
    """Reads a file that describes one model. Raises ModelError."""
    document = document or read_document(path)
    root = document.root
    if root.tag != "sdf":
        message = f"a model in SDF begins with <sdf>, this file with <{root.tag}>"
        hint = "; only SDF can be included in SDF: convert it" if root.tag == "robot" else ""
        refuse_errors([document.finding("not-a-robot", root, message + hint)])
    return SdfFile(path, _version(document), _only_model(document), document)


def _version(document: ModelDocument) -> Version:
    stated = document.root.get("version")
    if stated is None:
        problem = document.finding("missing-part", document.root, "<sdf> without 'version'")
        refuse_errors([problem])
    version = parsed_version(stated or "")
    if version < _OLDEST:
        message = f"SDF {shown(stated)} is not read; versions 1.4 to 1.11 are: 'gz sdf -p' writes a newer one"
        refuse_errors([document.finding("not-a-robot", document.root, message)])
    return version


def _only_model(document: ModelDocument) -> Element:
    root = document.root
    models, world = root.findall("model"), root.find("world")
    if world is not None:
        names = ", ".join(f"'{model.get('name', '')}'" for model in world.findall("model")) or "none"
        message = f"this SDF describes a world, whose models are {names}; a robot is one <model> right below <sdf>: "
        refuse_errors([document.finding("not-a-robot", world, f"{message}move it out of <world>, into its own file")])
    if not models:
        refuse_errors([document.finding("not-a-robot", root, "an SDF of a robot has a <model>, this one has none")])
    if len(models) > 1:
        names = ", ".join(f"'{model.get('name', '')}'" for model in models)
        message = f"this SDF has {len(models)} models: {names}; a robot is one, in which others may be nested"
        refuse_errors([document.finding("not-a-robot", models[1], message)])
    return models[0]


_MOST_INCLUDES: Final = 500


class OverBudget(Exception):
    """A model that is made of too much; there is nothing to gain from reading on."""


class Budget:
    """Reads the files of one model, each once, and counts what they come to."""

    def __init__(self, document: ModelDocument) -> None:
        self._read: dict[Path, ModelDocument] = {}
        self._includes = 0
        self._elements = len(document.places)
        self._bytes = document.size

    def begin_include(self) -> None:
        """One more is about to be read. Raises OverBudget."""
        self._includes += 1
        if self._includes > _MOST_INCLUDES:
            raise OverBudget(f"a model includes at most {_MOST_INCLUDES} others")

    def read(self, path: Path) -> ModelDocument:
        """A file, which may have been read before. Raises ModelError, OverBudget."""
        if path not in self._read:
            document = read_document(path)
            self.spend(document)
            self._bytes += document.size
            if self._bytes > MAX_BYTES:
                raise OverBudget(f"a model has at most {MAX_BYTES // 1_000_000} MB, with all that it includes")
            self._read[path] = document
        return self._read[path]

    def spend(self, document: ModelDocument) -> None:
        """Its elements are there once more. Raises OverBudget."""
        self._elements += len(document.places)
        if self._elements > MAX_ELEMENTS:
            raise OverBudget(f"a model has at most {MAX_ELEMENTS:,} elements, with all that it includes")
