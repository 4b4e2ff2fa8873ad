"""Inputs that once found a fault, or that stand for one that was mended. All of them are tried by `make test`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from tests.fuzz.cases import Case

CORPUS: Final[Mapping[str, Case]] = {}
"""Name -> input."""
