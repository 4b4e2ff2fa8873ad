"""How drives follow what they are told: by ramps."""

from __future__ import annotations


def towards(wanted: float, value: float, most: float) -> float:
    """The value after a step in which it changes by `most` at the most, on its way to what is wanted."""
    return value + max(-most, min(most, wanted - value))
