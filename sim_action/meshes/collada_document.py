"""What is looked up in a COLLADA file: identifiers, lines, and numbers in text."""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element

from sim_action.core.messages import shown
from sim_action.meshes.collada_xml import Lines
from sim_action.meshes.mesh import MeshError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class Document:
    """The elements of a file."""

    def __init__(self, root: Element, lines: Lines) -> None:
        self.root = root
        self._lines = lines
        self._by_id: dict[tuple[str, str], Element] = {}
        self._numbers: dict[Element, NDArray[np.float64]] = {}
        for element in lines:
            if "id" in element.attrib:
                self._by_id.setdefault((element.tag, element.attrib["id"]), element)

    def error(self, element: Element, message: str, rule: str = "broken-mesh") -> MeshError:
        """What is wrong with an element."""
        return MeshError(rule, f"<{element.tag[:40]}>: {message}", self._lines[element])

    def named(self, element: Element, attribute: str, tag: str) -> Element:
        """The element that an attribute of this one names. Raises MeshError."""
        name = element.get(attribute, "")
        found = self._by_id.get((tag, name[1:])) if name.startswith("#") else None
        if found is None:
            raise self.error(element, f"{attribute}={shown(name)}: there is no <{tag}> of this name in the file")
        return found

    def whole(self, element: Element, attribute: str, *, otherwise: int) -> int:
        """A whole number from 0. Raises MeshError."""
        text = element.get(attribute, str(otherwise)).strip()
        if not (text.isascii() and text.isdigit() and len(text) < 10):
            raise self.error(element, f"{attribute}={shown(text)}: expected a whole number from 0")
        return int(text)

    def positive(self, element: Element, attribute: str) -> float:
        """A number greater than 0. Raises MeshError."""
        text = element.get(attribute, "1")
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not 0 < number < math.inf:
            raise self.error(element, f"{attribute}={shown(text)}: expected a number greater than 0")
        return number

    def numbers(self, element: Element) -> NDArray[np.float64]:
        """The numbers that an element holds. Raises MeshError."""
        import numpy as np

        text = element.text or ""
        if not text.strip():
            return np.zeros(0)
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # of text that is no number
            try:
                return np.fromstring(text, sep=" ")
            except (ValueError, DeprecationWarning):
                raise self.error(element, "expected numbers, found other text") from None

    def numbers_once(self, element: Element) -> NDArray[np.float64]:
        """The same, for an element that others refer to, many perhaps."""
        if element not in self._numbers:
            self._numbers[element] = self.numbers(element)
        return self._numbers[element]

    def rows(self, element: Element) -> NDArray[np.int64]:
        """The whole numbers from 0 that an element holds. Raises MeshError."""
        import numpy as np

        found = self.numbers(element)
        if not ((found >= 0) & (found < 2**31) & (found == np.floor(found))).all():
            raise self.error(element, "expected whole numbers from 0", "mesh-index")
        return found.astype(np.int64)
