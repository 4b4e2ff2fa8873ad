"""Build hooks: the 3D viewer of report.html is packaged, and links of the README lead to the repository."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

VIEWER = "sim_action/reports/viewer/viewer3d.json"
REPOSITORY = "sim-action/sim-action"
# A link or a picture of Markdown that is neither an address nor a place on the same page.
_RELATIVE_LINK = re.compile(r"(?P<picture>!?)\[(?P<text>[^\]]*)\]\((?!\w+:|#)(?P<path>[^)\s]+)\)")


class ViewerBuildHook(BuildHookInterface[Any]):
    """Runs before a wheel or an sdist is put together."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Leaves a viewer alone that is there already: a tagged tree has one, and needs no Node.js."""
        root = Path(self.root)
        # An editable installation reads the tree itself, and `make viewer` is for that.
        if version != "editable" and not (root / VIEWER).exists():
            self._build(root / "tools/viewer")
        if (root / VIEWER).exists():
            build_data["artifacts"].append(VIEWER)

    def _build(self, sources: Path) -> None:
        npm = shutil.which("npm")
        if npm is None or shutil.which("node") is None or not sources.is_dir():
            self.app.display_warning("there is no Node.js: report.html is packaged without its 3D viewer")
            return
        try:
            for command in (("ci", "--ignore-scripts"), ("run", "--silent", "build")):
                subprocess.run([npm, *command], cwd=sources, check=True, capture_output=True, text=True)
        except subprocess.CalledProcessError as error:
            last = "\n".join(error.stderr.splitlines()[-5:])
            self.app.display_warning(f"report.html is packaged without its 3D viewer: {last}")


class ReadmeHook(MetadataHookInterface):
    """Makes the README the description of the package."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Point relative links to the repository at the tag of this version: on PyPI they would lead nowhere."""
        text = Path(self.root, "README.md").read_text(encoding="utf-8")
        metadata["readme"] = {"content-type": "text/markdown", "text": with_absolute_links(text, metadata["version"])}


def with_absolute_links(text: str, version: str) -> str:
    """Return Markdown whose links and pictures show the state of a released version."""

    def absolute(link: re.Match[str]) -> str:
        base = "https://raw.githubusercontent.com" if link["picture"] else "https://github.com"
        kind = "" if link["picture"] else "blob/"
        return f"{link['picture']}[{link['text']}]({base}/{REPOSITORY}/{kind}v{version}/{link['path']})"

    return _RELATIVE_LINK.sub(absolute, text)
