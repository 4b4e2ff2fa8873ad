"""A `robot:` block to paste into a scenario."""

from __future__ import annotations

import json
import re
from typing import Final

from sim_action.drives import Drive
from sim_action.robot.spec import Robot

# What every reader of YAML takes for this text, and for nothing else.
_PLAIN: Final = re.compile(r"(?:[A-Za-z_/]|\.\.?/)[A-Za-z0-9_./-]*")
_WORDS: Final = frozenset(["null", "true", "false", "yes", "no", "on", "off", "y", "n"])


def robot_block(robot: Robot, drive: Drive | None, *remarks: str) -> str:
    """The block of a robot; `remarks`: keys that are left to the reader, as comments."""
    stated = robot.model_dump(exclude_defaults=True)
    lines = [f"  {key}: {_flow(value)}" for key, value in stated.items()]
    lines += [f"  drive: {drive_text(drive)}"] if drive else []
    lines += [f"  # {remark}" for remark in remarks]
    return "\n".join(("robot:", *lines)) + "\n"


def drive_text(drive: Drive) -> str:
    """What stands behind `drive:`."""
    return _flow({drive.key: drive.model_dump(exclude_defaults=True)})


def _flow(value: object) -> str:
    """A value in YAML's flow style, on one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_flow(key)}: {_flow(part)}" for key, part in value.items()) + "}"
    if isinstance(value, (tuple, list)):
        return "[" + ", ".join(map(_flow, value)) + "]"
    if isinstance(value, str) and _PLAIN.fullmatch(value) and value.lower() not in _WORDS:
        return value
    # JSON is YAML, but for its two halves of a character beyond U+FFFF, and for what YAML takes for line breaks.
    text = json.dumps(value, ensure_ascii=False)
    return "".join(char if char.isprintable() else f"\\U{ord(char):08x}" for char in text)
