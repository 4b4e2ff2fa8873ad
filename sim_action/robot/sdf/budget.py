"""How much one model may be made of. It is read in the caller's process, and includes what a stranger likes."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from sim_action.robot.document import MAX_BYTES, MAX_ELEMENTS, ModelDocument, read_document

_MOST_INCLUDES: Final = 500


class OverBudget(Exception):
    """A model that is made of too much; there is nothing to gain from reading on."""


class Budget:
    """Reads the files of one model, each once, and counts what they come to."""

    def __init__(self, document: ModelDocument) -> None:
        self._read: dict[Path, ModelDocument] = {}
        self._includes = 0
        self._elements = len(document.places)
        self._bytes = document.size

    def begin_include(self) -> None:
        """One more is about to be read. Raises OverBudget."""
        self._includes += 1
        if self._includes > _MOST_INCLUDES:
            raise OverBudget(f"a model includes at most {_MOST_INCLUDES} others")

    def read(self, path: Path) -> ModelDocument:
        """A file, which may have been read before. Raises ModelError, OverBudget."""
        if path not in self._read:
            document = read_document(path)
            self.spend(document)
            self._bytes += document.size
            if self._bytes > MAX_BYTES:
                raise OverBudget(f"a model has at most {MAX_BYTES // 1_000_000} MB, with all that it includes")
            self._read[path] = document
        return self._read[path]

    def spend(self, document: ModelDocument) -> None:
        """Its elements are there once more. Raises OverBudget."""
        self._elements += len(document.places)
        if self._elements > MAX_ELEMENTS:
            raise OverBudget(f"a model has at most {MAX_ELEMENTS:,} elements, with all that it includes")
