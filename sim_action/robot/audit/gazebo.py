"""What is read of <gazebo> tags."""

from __future__ import annotations

from collections.abc import Iterator

from sim_action.core.messages import FirstFew, did_you_mean
from sim_action.robot.document import ModelDocument
from sim_action.robot.gazebo import NUMBERS, number_text
from sim_action.robot.robot_model import Finding
from sim_action.robot.values import is_expression, is_numbers


def numbers(document: ModelDocument) -> Iterator[Finding]:
    """Coefficients are numbers, and not below zero."""
    for tag in document.elements("gazebo"):
        for name in NUMBERS:
            text = number_text(tag, name)
            if text is None:
                continue
            message = f"<{name}>{text}</{name}>: expected a finite number that is not negative"
            if is_expression(text):
                yield document.finding("unexpanded-expression", tag, f"{message}; expand this expression of xacro")
            elif not is_numbers(text, 1) or float(text) < 0:
                yield document.finding("bad-number", tag, message)


def references(document: ModelDocument) -> Iterator[Finding]:
    """What is said of a link is said of one that is there."""
    names = {element.attrib["name"] for element in document.elements("link", "joint")}
    hinted = FirstFew()
    for tag in document.elements("gazebo"):
        name = tag.get("reference")
        if name is not None and name not in names:
            hint = did_you_mean(name, names) if hinted.one_more() else ""
            message = f'<gazebo reference="{name}">: no link or joint has this name{hint}'
            yield document.finding("unknown-reference", tag, message)


def directions(document: ModelDocument) -> Iterator[Finding]:
    """Friction is the same in all directions: the engines have one coefficient."""
    for tag in document.elements("gazebo"):
        mu1, mu2 = (number_text(tag, name) for name in ("mu1", "mu2"))
        if mu1 and mu2 and not is_expression(mu1 + mu2) and float(mu1) != float(mu2):
            message = f"friction of {mu1} in one direction and {mu2} in the other: mu1 counts in both"
            yield document.finding("two-frictions", tag, message)
