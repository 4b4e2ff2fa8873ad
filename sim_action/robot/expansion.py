"""xacro -> a document whose elements know where in the .xacro files they were written."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree as ET

from sim_action.core.errors import Location
from sim_action.robot.document import ModelDocument, shown_file, shown_place
from sim_action.robot.findings import finding, refuse_errors
from sim_action.robot.packages import Packages
from sim_action.robot.robot_model import Finding
from sim_action.robot.xacro_check import XacroCheck, check_xacro
from sim_action.robot.xacro_documents import XacroError
from sim_action.robot.xacro_files import Argument, expand


def read_xacro(
    path: Path, arguments: Mapping[str, Argument], packages: Packages
) -> tuple[ModelDocument, list[Finding]]:
    """Evaluates a file, which runs what is written in it, and what xacro warned of. Raises ModelError."""
    try:
        expansion = expand(path, arguments, packages)
    except XacroError as error:
        refuse_errors([_finding(error)])
        raise
    root = ET.fromstring(expansion.text)  # noqa: S314 - written by xacro from documents without a DOCTYPE
    places = {element: shown_place(place) for element, place in zip(root.iter(), expansion.places, strict=True)}
    warnings = [finding("xacro-warning", note, Location(shown_file(path))) for note in expansion.notes]
    return ModelDocument(root, places), warnings


def check_text(path: Path, arguments: Mapping[str, Argument], packages: Packages) -> tuple[str, ...]:
    """Looks at a file without evaluating it; returns what could not be checked so. Raises ModelError."""
    check: XacroCheck = check_xacro(path, arguments, packages)
    refuse_errors([_finding(problem) for problem in check.problems])
    return check.notes


def _finding(error: XacroError) -> Finding:
    return finding(error.rule, error.message, shown_place(error.location))
