"""The MuJoCo engine. MuJoCo is imported here for the first time, so that its import takes two thirds of the time."""

from __future__ import annotations

import sys
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Final

PLUGINS: Final = "mujoco.plugins"  # the group of entry points with which packages add plugins to MuJoCo


def import_mujoco() -> None:
    """Import MuJoCo, without its search for plugins if no package has some: the search alone imports 25 modules."""
    name = "importlib.metadata"
    if name in sys.modules or _have_plugins():
        import_module("mujoco")
        return
    stand_in = sys.modules[name] = ModuleType(name)
    vars(stand_in).update(entry_points=lambda **_: ())
    try:
        import_module("mujoco")
    finally:
        del sys.modules[name]


def _have_plugins() -> bool:
    """Return True if installed packages state plugins, or if that cannot be read."""
    stated = (file for folder in dict.fromkeys(sys.path) for file in Path(folder).glob("*-info/entry_points.txt"))
    with suppress(OSError):
        return any(f"[{PLUGINS}]".encode() in file.read_bytes() for file in stated)
    return True


import_mujoco()
