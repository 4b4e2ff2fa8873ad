"""SDF files, and the <model> in each."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.core.messages import shown
from sim_action.robot.document import ModelDocument, read_document
from sim_action.robot.findings import refuse_errors
from sim_action.robot.model_files import Version, parsed_version

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
