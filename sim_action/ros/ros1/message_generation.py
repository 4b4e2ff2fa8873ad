"""Messages and services for Python, as genpy writes them: gazebo_msgs, and those of packages that nobody has built."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from sim_action.core.errors import UsageError
from sim_action.ros.ros1.installation import Ros

_KINDS: Final = ("msg", "srv")

# One interpreter for all: to start one for each kind of each package takes longer than what they do.
_GENERATION: Final = """\
import json, os, sys
from genpy.generator import MsgGenerator, SrvGenerator
from genpy.generate_initpy import write_modules
task = json.load(sys.stdin)
for package, kinds in task["packages"].items():
    for kind, generator in (("msg", MsgGenerator()), ("srv", SrvGenerator())):
        if kinds[kind]:
            folder = os.path.join(task["modules"], package, kind)
            os.mkdir(folder)
            code = generator.generate_messages(package, kinds[kind], folder, task["includes"])
            if code:
                sys.exit(code)
            write_modules(folder)
"""

# A package may have modules of its own beside those that are written here.
_INIT: Final = '__path__ = __import__("pkgutil").extend_path(__path__, __name__)\n'


def generate_messages(packages: Mapping[str, Path], known: Mapping[str, Path], modules: Path, ros: Ros) -> None:
    """Writes modules below a folder, for packages by name; `known`: all whose messages theirs may hold.

    Raises UsageError.
    """
    definitions = {name: _definitions(folder) for name, folder in packages.items()}
    written = {name: kinds for name, kinds in definitions.items() if any(kinds.values())}
    for name in written:
        (modules / name).mkdir()
        (modules / name / "__init__.py").write_text(_INIT)
    includes = {name: [str(folder / "msg")] for name, folder in known.items() if (folder / "msg").is_dir()}
    task = json.dumps({"packages": written, "modules": str(modules), "includes": includes})
    command = [str(ros.python), "-c", _GENERATION]
    # What it reads comes on standard input.
    made = subprocess.run(  # noqa: S603 - the distribution's Python and a program of ours
        command, input=task, capture_output=True, text=True, check=False, cwd="/"
    )
    if made.returncode:
        said = (made.stderr.strip() or made.stdout.strip()).splitlines()[-1:]
        raise UsageError(f"genpy cannot write the messages of {', '.join(written)}: {' '.join(said)}")


def _definitions(package: Path) -> dict[str, list[str]]:
    return {kind: [str(file) for file in sorted((package / kind).glob(f"*.{kind}"))] for kind in _KINDS}
