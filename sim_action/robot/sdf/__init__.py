"""SDF (sdformat.org/spec, versions 1.4 to 1.11) -> a URDF document whose elements know their place in the SDF.

The base link's frame is the root link's own. A link that hangs on a turning joint whose axis does not run through its
origin has its frame at the joint (`hinges.py`); all others have that of the SDF. What an SDF fixes to the world hangs
on a root link named `world`, which is the world as the file has it: with the <pose> of the outermost <model>.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from sim_action.robot.document import ModelDocument
from sim_action.robot.findings import refuse_errors
from sim_action.robot.model_files import NEWEST
from sim_action.robot.packages import Packages
from sim_action.robot.robot_model import Finding
from sim_action.robot.sdf.assembly import Assembly
from sim_action.robot.sdf.conversion import convert
from sim_action.robot.sdf.files import read_sdf_file
from sim_action.robot.sdf.problems import Notes


def urdf_of_sdf(
    document: ModelDocument, path: Path, packages: Packages, allow: Iterable[str]
) -> tuple[ModelDocument, tuple[Finding, ...]]:
    """The URDF of a parsed SDF, and what was odd or let go; `path`: of its file. Raises ModelError."""
    file, notes = read_sdf_file(path.resolve(), document), Notes()
    scope = Assembly(file, packages, notes).read()
    if file.version > NEWEST:
        message = f"SDF {document.root.get('version')} is read as {NEWEST[0]}.{NEWEST[1]}"
        notes.tell("passed-over", document.root, message)
    allowed = set(allow)
    refuse_errors(notes.findings, allowed)
    urdf = convert(scope, notes)
    refuse_errors(notes.findings, allowed)
    return urdf, tuple(notes.findings)
