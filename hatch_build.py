"""Builds the 3D viewer of report.html into what is packaged; where there is no Node.js, reports draw from above."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

VIEWER = "sim_action/reports/viewer/viewer3d.json"


class ViewerBuildHook(BuildHookInterface[Any]):
    """Runs before a wheel or an sdist is put together."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Leaves a viewer alone that is there already: a tagged tree has one, and needs no Node.js."""
        root = Path(self.root)
        # An editable installation reads the tree itself, and `make viewer` is for that.
        if version != "editable" and not (root / VIEWER).exists():
            self._build(root / "web")
        if (root / VIEWER).exists():
            build_data["artifacts"].append(VIEWER)

    def _build(self, web: Path) -> None:
        npm = shutil.which("npm")
        if npm is None or shutil.which("node") is None or not web.is_dir():
            self.app.display_warning("there is no Node.js: report.html is packaged without its 3D viewer")
            return
        try:
            for command in (("ci", "--ignore-scripts"), ("run", "--silent", "build")):
                subprocess.run([npm, *command], cwd=web, check=True, capture_output=True, text=True)
        except subprocess.CalledProcessError as error:
            last = "\n".join(error.stderr.splitlines()[-5:])
            self.app.display_warning(f"report.html is packaged without its 3D viewer: {last}")
