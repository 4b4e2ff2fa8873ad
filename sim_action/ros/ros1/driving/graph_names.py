"""Names of nodes and topics, as ROS 1 has them (wiki.ros.org/Names)."""

from __future__ import annotations

import re
from typing import Annotated, Final

from pydantic import AfterValidator

_BASE: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_GRAPH: Final = re.compile(r"[~/]?[A-Za-z][A-Za-z0-9_]*(?:/[A-Za-z0-9_]+)*")


def _base_name(name: str) -> str:
    """Raises ValueError."""
    if not _BASE.fullmatch(name):
        raise ValueError(f"a node's name is letters, digits and '_', a letter first, found {name!r}")
    return name


def _graph_name(name: str) -> str:
    """Raises ValueError."""
    if not _GRAPH.fullmatch(name):
        raise ValueError(f"a name of ROS is letters, digits, '_' and '/', such as /arm/cmd_vel, found {name!r}")
    return name


BaseName = Annotated[str, AfterValidator(_base_name)]
GraphName = Annotated[str, AfterValidator(_graph_name)]
