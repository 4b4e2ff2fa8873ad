"""A sequence of twists: `twist: [{linear: 1.0, for: 2 s}, {linear: 0.2}]`."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator
from itertools import accumulate
from typing import Annotated, ClassVar, Final

from pydantic import Field
from typing_extensions import override

from sim_action.commands import CommandSource, Controller, OpenLoop
from sim_action.core.field_types import FrozenModel, MetresPerSecond, PositiveSeconds, RadiansPerSecond
from sim_action.core.geometry import Twist
from sim_action.core.units import display
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import SpecProblems
from sim_action.state.command import Command
from sim_action.state.timeline import TimeMark
from sim_action.world import MAX_PHYSICS_RATE_HZ
from sim_action.world.claims import MANY_S, ClaimFinding, Findings, Setting
from sim_action.world.scene import Scene

_ROUNDING: Final = 1e-9  # sim time is step / rate, so equal times may differ by rounding
_MAX_TICK: Final = 2.0**53  # beyond, floats do not distinguish ticks


def missed_by_ticks(start: float, duration: float, rate: float) -> str | None:
    """Return a message if no tick, at `rate` Hz, falls into a span of sim time from `start` in s; else None."""
    end = start + duration
    first_tick = math.ceil(min((start - _ROUNDING) * rate, _MAX_TICK)) / rate
    if first_tick + _ROUNDING < end:
        return None
    missed = f"no tick falls between {display(start, 's')} and {display(end, 's')}, so it has no effect"
    apart = f"ticks are {display(1 / rate, 's')} apart (rate: {rate:g} Hz)"
    least = 1 / duration - _ROUNDING
    faster = f", or set rate: {math.ceil(least)} Hz" if least <= MAX_PHYSICS_RATE_HZ else ""
    return f"{missed}; {apart}: make it at least that long{faster}"


class TwistSegment(FrozenModel):
    """A twist for a duration."""

    linear: Annotated[MetresPerSecond, Field(description="forward speed of the base")] = 0.0
    lateral: Annotated[MetresPerSecond, Field(description="speed to the left; needs mecanum wheels")] = 0.0
    angular: Annotated[RadiansPerSecond, Field(description="turning rate to the left")] = 0.0
    duration: Annotated[
        PositiveSeconds | None,
        Field(alias="for", description="duration; the last segment may omit it to last until the end"),
    ] = None

    @property
    def words(self) -> str:
        """The command of this segment in words."""
        speeds = ((self.linear, "m/s"), (self.lateral, "m/s to the left"), (self.angular, "rad/s"))
        moving = " and ".join(display(value, unit) for value, unit in speeds if value)
        return f"commanded {moving or 'to stop'}"

    @property
    def twist(self) -> Twist:
        """The command of this segment."""
        return Twist.planar(self.linear, self.angular, lateral=self.lateral)


class TwistCommands(CommandSource):
    """Commands twists of the base, one after the other. If the last one has a duration, the base then stops."""

    key: ClassVar[str] = "twist"
    needs_drive: ClassVar[bool] = True
    is_written: ClassVar[bool] = True

    twist: Annotated[tuple[TwistSegment, ...], Field(min_length=1)]

    def problems(self, workspace: Workspace) -> SpecProblems:
        """Yield segments without an end before the last one, and segments too short to contain a tick."""
        endless = [index for index, segment in enumerate(self.twist[:-1]) if segment.duration is None]
        if endless:
            yield from ((("twist", index), "only the last segment may omit 'for'") for index in endless)
            return
        start = 0.0
        for index, (segment, end) in enumerate(zip(self.twist, self._ends, strict=True)):
            if segment.duration is not None and (problem := missed_by_ticks(start, segment.duration, self.rate)):
                yield ("twist", index, "for"), problem
            start = end

    @override
    def claims(self, setting: Setting) -> Findings:
        start, limit = 0.0, setting.time_limit
        for index, segment in enumerate(self.twist):
            if start >= limit:
                message = f"this segment begins at {start:g} s, but the run ends at {limit:g} s (time_limit)"
                use = "shorten the segments before it, or remove it"
                yield ClaimFinding("segment-beyond-run", ("twist", index), f"{message}; {use}")
            elif segment.duration is not None and segment.duration > limit:
                message = f"this segment lasts {segment.duration:g} s, but the run ends at {limit:g} s (time_limit)"
                hint = f"; '{segment.duration:g} ms' meant?" if segment.duration >= MANY_S else ""
                yield ClaimFinding("segment-beyond-run", ("twist", index, "for"), f"{message}{hint}")
            elif segment.duration is not None:
                start += segment.duration
                continue
            return

    @override
    def time_marks(self, sender: str) -> Iterator[TimeMark]:
        yield from super().time_marks(sender)
        words = (*(segment.words for segment in self.twist), "commanded to stop")
        for start, before, what in zip((0.0, *self._ends), ("", *words), words, strict=False):
            if start < math.inf and what != before:
                yield TimeMark(start, start, what, is_planned=True)

    @property
    def _ends(self) -> tuple[float, ...]:
        return tuple(accumulate(math.inf if s.duration is None else s.duration for s in self.twist))

    @override
    def open(self, scene: Scene) -> Controller:
        ends = self._ends
        twists = (*(segment.twist for segment in self.twist), Twist())

        def command(time: float) -> Command:
            # A tick at the end of a segment belongs to the next one, also if the times differ by rounding.
            return twists[bisect_right(ends, time + _ROUNDING)]

        return OpenLoop(command)
