"""Elements of JUnit XML, and their text on indented lines."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from typing import Final

from sim_action.reports.escaping import plain_text

_ATTACHMENT: Final = "[[ATTACHMENT|"


def element(tag: str, attributes: Mapping[str, object]) -> ET.Element:
    """Return an element with attributes; those that are None are omitted."""
    texts = {name: plain_text(str(value)) for name, value in attributes.items() if value is not None}
    return ET.Element(tag, texts)


def add_child(parent: ET.Element, tag: str, text: str, attributes: Mapping[str, object] | None = None) -> None:
    """Add a child element with text."""
    child = element(tag, attributes or {})
    child.text = _harmless(text)
    parent.append(child)


def add_line(parent: ET.Element, tag: str, text: str) -> None:
    """Append lines to the single child element with this tag, unless the text is empty."""
    if text:
        _append(parent, tag, _harmless(text))


def add_attachment(parent: ET.Element, path: str) -> None:
    """Name a file that belongs to a testcase, in the syntax of the Jenkins plugin and of GitLab."""
    _append(parent, "system-out", f"{_ATTACHMENT}{plain_text(path)}]]")


def add_properties(parent: ET.Element, values: Mapping[str, object]) -> None:
    """Add properties as the first child; those that are None are omitted."""
    properties = parent.find("properties")
    if properties is None:
        properties = ET.Element("properties")
        parent.insert(0, properties)
    properties.extend(_properties(values))


def _properties(values: Mapping[str, object]) -> Iterator[ET.Element]:
    for name, value in values.items():
        if value is not None:
            text = f"{value:.9g}" if isinstance(value, float) else value
            yield element("property", {"name": name, "value": text})


def property_lines(values: Mapping[str, object]) -> str:
    """Return the lines of the properties of a suite."""
    return "".join([element_lines(each, INDENT * 3) for each in _properties(values)])


INDENT: Final = "  "
_SPECIAL: Final = re.compile('[&<>"\r\n\t]')
_IN_TEXT: Final = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;"})
_IN_ATTRIBUTE: Final = _IN_TEXT | str.maketrans({'"': "&quot;", "\r": "&#13;", "\n": "&#10;", "\t": "&#09;"})


def element_lines(item: ET.Element, indent: str) -> str:
    """Return an element with its children on lines of their own, as `ElementTree.indent` and `write` do."""
    start = f"{indent}{start_tag(item)}"
    if len(item):
        children = "".join([element_lines(child, indent + INDENT) for child in item])
        return f"{start}>\n{children}{indent}</{item.tag}>\n"
    if not item.text:
        return f"{start} />\n"
    text = item.text.translate(_IN_TEXT) if _SPECIAL.search(item.text) else item.text
    return f"{start}>{text}</{item.tag}>\n"


def start_tag(item: ET.Element) -> str:
    """Return the start tag of an element without its end."""
    texts = [
        f' {name}="{value.translate(_IN_ATTRIBUTE) if _SPECIAL.search(value) else value}"'
        for name, value in item.attrib.items()
    ]
    return f"<{item.tag}{''.join(texts)}"


def encoded(text: str) -> bytes:
    """Return text in UTF-8; half a surrogate pair becomes a character reference."""
    return text.encode("utf-8", errors="xmlcharrefreplace")


def _append(parent: ET.Element, tag: str, text: str) -> None:
    child = parent.find(tag)
    if child is None:
        child = ET.SubElement(parent, tag)
    child.text = f"{child.text}\n{text}" if child.text else text


def _harmless(text: str) -> str:
    return plain_text(text).replace(_ATTACHMENT, "[[ATTACHMENT |")
