"""The scenarios of the examples."""

from __future__ import annotations

from pathlib import Path
from typing import Final

_ROOT: Final = Path(__file__).parents[1]

EXAMPLES: Final = sorted(
    path for path in _ROOT.glob("examples/**/*.sim.yml") if not path.is_relative_to(_ROOT / "examples/packages")
)
"""All but those that need an example package, which is not installed here."""
