"""The version of sim-action and the folder of its package."""

from __future__ import annotations

from pathlib import Path
from typing import Final

__version__ = "0.9.0"
PACKAGE_FOLDER: Final = Path(__file__).absolute().parent.parent
