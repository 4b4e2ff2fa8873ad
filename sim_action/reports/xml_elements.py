"""XML elements whose text comes from strangers: what XML forbids is out, and it names no attachment."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from typing import Final

from sim_action.reports.escaping import plain_text

_ATTACHMENT: Final = "[[ATTACHMENT|"


def element(tag: str, attributes: Mapping[str, object]) -> ET.Element:
    """An element with attributes; those that are None are left out."""
    texts = {name: plain_text(str(value)) for name, value in attributes.items() if value is not None}
    return ET.Element(tag, texts)


def add_child(parent: ET.Element, tag: str, text: str, attributes: Mapping[str, object] | None = None) -> None:
    """Adds an element with text."""
    child = element(tag, attributes or {})
    child.text = _harmless(text)
    parent.append(child)


def add_line(parent: ET.Element, tag: str, text: str) -> None:
    """Adds a line, or several, to the one child of this kind; nothing if the text is empty."""
    if text:
        _append(parent, tag, _harmless(text))


def add_attachment(parent: ET.Element, path: str) -> None:
    """Names a file that belongs to a testcase, in the words that Jenkins' plugin and GitLab look for."""
    _append(parent, "system-out", f"{_ATTACHMENT}{plain_text(path)}]]")


def add_properties(parent: ET.Element, values: Mapping[str, object]) -> None:
    """Adds properties, which come first; those that are None are left out."""
    properties = parent.find("properties")
    if properties is None:
        properties = ET.Element("properties")
        parent.insert(0, properties)
    for name, value in values.items():
        if value is not None:
            text = f"{value:.9g}" if isinstance(value, float) else value
            properties.append(element("property", {"name": name, "value": text}))


def _append(parent: ET.Element, tag: str, text: str) -> None:
    child = parent.find(tag)
    if child is None:
        child = ET.SubElement(parent, tag)
    child.text = f"{child.text}\n{text}" if child.text else text


def _harmless(text: str) -> str:
    """A stranger's text could name any file of the machine as an attachment, to be copied and published."""
    return plain_text(text).replace(_ATTACHMENT, "[[ATTACHMENT |")
