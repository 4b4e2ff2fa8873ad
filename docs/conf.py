"""Settings of Sphinx, which builds the site: `make docs`. See contributing/documents.md."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from sim_action import __version__  # noqa: E402 - after the path is set

REPOSITORY = "https://github.com/sim-action/sim-action"

project = "sim-action"
author = "sim-action contributors"
project_copyright = "sim-action contributors"
version = release = __version__

extensions = ["myst_parser"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["_site", "**/__pycache__"]
nitpicky = True
smartquotes = False  # it would turn --option into a dash
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence"]

html_theme = "furo"
html_title = "sim-action"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_extra_path = ["llms.txt", "scenario.schema.json", "base.schema.json", "results.schema.json", "proof.schema.json"]
html_copy_source = False
html_use_index = False
html_theme_options = {"source_repository": REPOSITORY, "source_branch": "main", "source_directory": "docs/"}
pygments_style = "a11y-light"
pygments_dark_style = "monokai"


class RepositoryLinks(SphinxTransform):
    """Links to files outside docs/ lead to the repository; MyST has checked that the files exist."""

    default_priority: ClassVar[int] = 500

    def apply(self, **_: Any) -> None:
        """Replace each download of such a file by a link."""
        for link in list(self.document.findall(addnodes.download_reference)):
            folder = Path(self.env.doc2path(self.env.docname)).parent
            path = Path(os.path.normpath(folder / link["reftarget"]))
            if ROOT / "docs" not in path.parents:
                address = f"{REPOSITORY}/blob/main/{path.relative_to(ROOT).as_posix()}"
                link.replace_self(nodes.reference("", "", *link.children, refuri=address, internal=False))


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the transform."""
    app.add_transform(RepositoryLinks)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
