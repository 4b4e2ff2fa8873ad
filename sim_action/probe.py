"""What sensors may ask an engine for, beside the state of the base and the joints. Nothing of it changes a run."""

from __future__ import annotations

from typing import Protocol


class Probe(Protocol):
    """An engine, as sensors see it."""
