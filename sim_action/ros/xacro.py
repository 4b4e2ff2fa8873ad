"""The program `xacro` of launch files: expands a file as the robot models of scenarios are, and prints URDF.

It accepts the command line that launch files use: `xacro [--inorder] [-o FILE] FILE [NAME:=VALUE ...]`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from sim_action.core.errors import ModelError
from sim_action.core.wording import escaped_line
from sim_action.core.workspace import Workspace
from sim_action.robot.documents.packages import Packages
from sim_action.robot.reading.xacro_documents import UnknownArgument, XacroError
from sim_action.robot.reading.xacro_expansion import Expansion, expand

_FALLBACKS: Final = Path(__file__).parent / "ros1/launch/packages"


def main(words: Sequence[str] | None = None) -> int:
    """Expand a file, and return the exit code. An error is one line on standard error that begins with `xacro:`."""
    parser = argparse.ArgumentParser("xacro", allow_abbrev=False)
    parser.add_argument("file")
    parser.add_argument("-o", dest="output")
    for ignored in (("--inorder", "-i"), ("--xacro-ns",), ("--check-order",), ("-q",), ("-v",)):
        parser.add_argument(*ignored, action="store_true")
    parser.add_argument("--verbosity")
    asked, others = parser.parse_known_args(words)
    arguments = dict(word.split(":=", 1) for word in others if ":=" in word)
    path = Path(asked.file)
    try:
        text = _expanded(path, {name: value for name, value in arguments.items() if not name.startswith("_")}).text
    except (ModelError, XacroError) as error:
        sys.stderr.write(f"xacro: {escaped_line(str(error))}\n")
        return 2
    if asked.output:
        Path(asked.output).write_text(text, encoding="utf-8")
    else:
        sys.stdout.write(text)
    return 0


def _expanded(path: Path, arguments: Mapping[str, str]) -> Expansion:
    """Expand a file without arguments that it does not declare. Raises XacroError, ModelError."""
    if not path.is_file():
        raise ModelError(_missing(path))
    folder = path.resolve().parent
    packages = Packages(Workspace(folder, folder, allow_outside=True))
    left = dict(arguments)
    while True:
        try:
            return expand(path, left, packages)
        except UnknownArgument as error:
            # ROS ignores arguments that a file does not declare.
            del left[error.argument]


def _missing(path: Path) -> str:
    folder = path.parent
    names = ", ".join(sorted(file.name for file in folder.iterdir())) if folder.is_dir() else "nothing"
    if folder.is_dir() and _FALLBACKS in folder.resolve().parents:
        return (
            f"'{path.name}' does not exist: sim-action includes only {names} of TurtleBot3; add ROBOTIS's package "
            "turtlebot3_description to the workspace for the others, or set TURTLEBOT3_MODEL=burger"
        )
    return f"'{path}' does not exist (the folder has {names})"


if __name__ == "__main__":
    sys.exit(main())
