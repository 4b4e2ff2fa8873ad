"""Efforts that nodes apply to joints by a service, each for a time; those of one joint add up."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim_action.core.geometry import Twist
from sim_action.state.command import Answer, JointTargets, commands_of


@dataclass(frozen=True, slots=True)
class Effort:
    """N m (or N) on a joint, from one sim time in s to another."""

    joint: str
    value: float
    begins: float
    ends: float


class Efforts:
    """Those of the one robot."""

    def __init__(self) -> None:
        self._efforts: tuple[Effort, ...] = ()
        self._moved: frozenset[str] = frozenset()

    def apply(self, joint: str, value: float, begins: float, seconds: float) -> None:
        """`seconds` negative: for ever."""
        ends = math.inf if seconds < 0 else begins + seconds
        self._efforts = (*self._efforts, Effort(joint, value, begins, ends))

    def clear(self, joint: str) -> None:
        """Ends all on a joint."""
        self._efforts = tuple(effort for effort in self._efforts if effort.joint != joint)

    def clear_all(self) -> None:
        """Of a robot that is gone."""
        self._efforts, self._moved = (), frozenset()

    def added_to(self, answer: Answer, seconds: float, wheels: frozenset[str]) -> Answer:
        """With efforts in the place of what moves their joints otherwise; `wheels`: which a twist turns, and they not.

        A joint whose effort has ended is let go, unless something else moves it.
        """
        if not self._efforts and not self._moved:
            return answer
        commands = commands_of(answer)
        is_driven = any(isinstance(command, Twist) for command in commands)
        sums: dict[str, float] = {}
        for effort in self._efforts:
            if effort.begins <= seconds < effort.ends and not (is_driven and effort.joint in wheels):
                sums[effort.joint] = sums.get(effort.joint, 0.0) + effort.value
        self._efforts = tuple(effort for effort in self._efforts if seconds < effort.ends)
        let_go = JointTargets(effort=dict.fromkeys(self._moved - sums.keys() - (wheels if is_driven else set()), 0.0))
        self._moved = frozenset(sums)
        return (let_go, *commands, JointTargets(effort=sums))
