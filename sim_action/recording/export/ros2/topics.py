"""A topic of a log, and times as messages have them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim_action.state.trace import FloatArray

_NANOSECONDS = 1_000_000_000


@dataclass(frozen=True)
class Topic:
    """All messages of one topic.

    Attributes:
        type: such as "std_msgs/String".
        time: of each message, in ns of sim time.
        messages: encoded.
        about: what there is to say of it, for people.
    """

    name: str
    type: str
    time: NDArray[np.int64]
    messages: list[bytes]
    about: dict[str, str] = field(default_factory=dict)


def nanoseconds(time: ArrayLike) -> NDArray[np.int64]:
    """(N,) of (N,) s."""
    return np.rint(np.asarray(time, dtype=np.float64) * _NANOSECONDS).astype(np.int64)


def stamps(time: FloatArray) -> NDArray[np.int64]:
    """(N, 2) builtin_interfaces/Time of (N,) s: whole seconds, and nanoseconds."""
    return np.column_stack(np.divmod(nanoseconds(time), _NANOSECONDS))
