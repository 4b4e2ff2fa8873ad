"""The import of MuJoCo: it searches for plugins only if a package has some."""

from __future__ import annotations

import importlib
import sys
from importlib import import_module
from pathlib import Path

import pytest

from sim_action.engines.mujoco import PLUGINS, import_mujoco

SEARCHING = f"""\
import importlib.metadata as metadata
plugins = [entry.name for entry in metadata.entry_points(group="{PLUGINS}")]
"""


@pytest.mark.parametrize(
    ("stated", "plugins"),
    [
        ("", None),
        ("[console_scripts]\nadder = adder:main\n", None),
        (f"[{PLUGINS}]\nadder = adder:load\n", ["adder"]),
        (None, []),
    ],
)
def test_only_an_installed_plugin_is_searched_for(
    stated: str | None, plugins: list[str] | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`plugins`: those that the search finds; None: there is no search. None for the statement: it cannot be read."""
    (tmp_path / "mujoco.py").write_text(SEARCHING)
    (package := tmp_path / "adder-1.0.dist-info").mkdir()
    (package / "METADATA").write_text("Metadata-Version: 2.1\nName: adder\nVersion: 1.0\n")
    if stated is None:
        (package / "entry_points.txt").mkdir()
    elif stated:
        (package / "entry_points.txt").write_text(stated)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    for name in ("mujoco", "importlib.metadata"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.delattr(importlib, "metadata", raising=False)
    import_mujoco()
    assert sys.modules["mujoco"].plugins == (plugins or [])
    assert ("importlib.metadata" in sys.modules) == (plugins is not None)
    # Whoever needs the module later gets all of it.
    assert import_module("importlib.metadata").version("adder") == "1.0"
