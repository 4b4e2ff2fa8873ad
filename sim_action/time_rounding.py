"""How far apart two ways to the same moment may be."""

from __future__ import annotations

from typing import Final

TIME_EPSILON: Final = 1e-9
"""In s. Sim time is step / rate: two ways to the same moment differ by rounding alone."""
