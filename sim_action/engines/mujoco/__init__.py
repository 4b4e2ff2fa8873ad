"""The MuJoCo engine. MuJoCo is imported here for the first time, so that its import costs two thirds of the time."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Final

PLUGINS: Final = "mujoco.plugins"  # the group of entry points with which packages add plugins to MuJoCo


def import_mujoco() -> None:
    """Import MuJoCo, without its search for plugins if no package has some: the search alone imports 25 modules."""
    name = "importlib.metadata"
    if name in sys.modules or any(f"[{PLUGINS}]".encode() in stated for stated in _entry_points()):
        import_module("mujoco")
        return
    stand_in = sys.modules[name] = ModuleType(name)
    vars(stand_in).update(entry_points=lambda **_: ())
    try:
        import_module("mujoco")
    finally:
        del sys.modules[name]


def _entry_points() -> Iterator[bytes]:
    """Yield the entry points that installed packages state."""
    for folder in dict.fromkeys(sys.path):
        with suppress(OSError):
            for package in os.listdir(folder or os.curdir):  # noqa: PTH208 - several times quicker than pathlib
                if package.endswith((".dist-info", ".egg-info")):
                    with suppress(OSError):
                        yield Path(folder, package, "entry_points.txt").read_bytes()


import_mujoco()
