"""What the engine's tables hold of one body: beyond them, PyBullet tells of other joints than those that are there.

It answers with a state of MAX_DEGREE_OF_FREEDOM = 128 numbers, and knows MAX_NUM_LINKS = 128 links (both in Bullet's
examples/SharedMemory/SharedMemoryCommands.h; bulletphysics/bullet3 issue 4621 asks for more). 7 of those numbers are
the pose of the base, also of one that is bolted to the world. A joint that comes after them reads 0, and its position
is told as a velocity of the base, all without a word; of a 129th link on, it answers nothing. Both were measured with
3.2.7, and are held by tests/integration/test_engine_tables.py.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final
from xml.etree.ElementTree import Element

from sim_action.robot.document import ModelDocument
from sim_action.robot.robot_model import MOVING_TYPES, Finding

MOST_MOVING_JOINTS: Final = 128 - 7
"""Of joints that have a position."""

MOST_JOINTS: Final = 128 - 1
"""Of all joints, those that are fixed too: one link is the base."""

_ADVICE: Final = "make one link of those that fixed joints hold together, and leave out what need not move"


def counts(document: ModelDocument) -> Iterator[Finding]:
    """The engine has room for all joints."""
    joints = list(document.elements("joint"))
    moving = [joint for joint in joints if joint.get("type") in MOVING_TYPES]
    yield from _beyond(document, joints, MOST_JOINTS, "joints")
    yield from _beyond(document, moving, MOST_MOVING_JOINTS, "joints that move")


def _beyond(document: ModelDocument, joints: Sequence[Element], most: int, what: str) -> Iterator[Finding]:
    if len(joints) > most:
        message = f"{len(joints)} {what}, and the engine takes {most}: {_ADVICE}"
        yield document.finding("too-many-joints", joints[most], message)
