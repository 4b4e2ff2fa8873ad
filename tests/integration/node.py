"""The Node.js and the packages of the checks, which `make test` installs."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Final

MODULES: Final = Path(__file__).parents[2] / "tools/workflows/node_modules"

ENVIRONMENT: Final = {**os.environ, "PATH": f"{sys.prefix}/bin:{os.environ['PATH']}"}
"""The machine's Node.js, or that of the virtual environment."""
