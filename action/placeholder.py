"""Placeholders of engines that were left out: modules that install the engine when it is first imported.

The engine counts as installed, with its version, so an engine that was left out by a wrong guess changes no result. The
engine itself hides the placeholder: Python prefers packages and extension modules to source files.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Final

_TEXT: Final = '''\
"""A placeholder of {engine}, which no scenario was seen to ask for: it is installed when it is first imported."""
import importlib
import subprocess
import sys

sys.stderr.write("{engine} is installed now, because a scenario asks for it.\\n")
_done = subprocess.run({command!r}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
if _done.returncode:
    _reason = "{engine} could not be installed: " + _done.stdout.decode("utf-8", "replace").strip()
    sys.stderr.write(_reason + "\\n")
    raise ImportError(_reason)
del sys.modules[__name__]
importlib.invalidate_caches()
importlib.import_module(__name__)
'''


def write(engine: str, package: str, version: str, command: Sequence[str], folder: Path) -> None:
    """Write the placeholder of an engine into a folder of packages. `command`: installs the engine."""
    folder.joinpath(f"{engine}.py").write_text(
        _TEXT.format(engine=engine, command=list(command)), encoding="utf-8", newline="\n"
    )
    metadata = folder / f"{package.replace('-', '_')}-{version}.dist-info"
    metadata.mkdir()
    metadata.joinpath("METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {package}\nVersion: {version}\n", encoding="utf-8", newline="\n"
    )


def replace(engine: str, staging: Path, folder: Path) -> None:
    """Move the files of an unpacked engine into a folder of packages; the files that Python looks for come last.

    Files that another process has moved there already stay as they are. Raises OSError.
    """
    for path in sorted(staging.iterdir(), key=lambda path: path.name.partition(".")[0] == engine):
        try:
            path.rename(folder / path.name)
        except OSError:
            # The dist-info of the placeholder, or the files of another process.
            if not (folder / path.name).exists():
                raise
            if path.name.endswith(".dist-info"):
                shutil.copytree(path, folder / path.name, dirs_exist_ok=True)
