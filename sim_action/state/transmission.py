"""The transmission of commands and of sensor readings: latency, jitter and dropouts."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from typing import Annotated, Final, Generic, TypeVar

from pydantic import Field

from sim_action.core.field_types import FrozenModel, NonNegativeSeconds, NonNegativeShare
from sim_action.core.lazy_numpy import Generator
from sim_action.core.units import display, first_step
from sim_action.state.timeline import TimeMark

Message = TypeVar("Message")


class Transmission(FrozenModel):
    """The keys of parts that send: command sources send commands, sensors send readings."""

    latency: Annotated[
        NonNegativeSeconds, Field(description="delay of each command or reading, rounded up to whole physics steps")
    ] = 0.0
    jitter: Annotated[
        NonNegativeSeconds,
        Field(description="largest additional delay; each is drawn at random, uniformly between 0 and this"),
    ] = 0.0
    dropouts: Annotated[
        NonNegativeShare, Field(lt=1, description="probability that a command or reading is lost; each is drawn alone")
    ] = 0.0

    @property
    def is_random(self) -> bool:
        """True if delays or losses are drawn at random."""
        return bool(self.jitter or self.dropouts)

    def time_marks(self, sender: str) -> Iterator[TimeMark]:
        """Yield the marks of the timeline that the run cannot change; `sender`: the source of the messages in words."""
        if self.latency or self.jitter:
            most = f" to {display(self.latency + self.jitter, 's')}" if self.jitter else ""
            yield TimeMark(0.0, None, f"messages of {sender} arrived {display(self.latency, 's')}{most} late")

    @property
    def is_perfect(self) -> bool:
        """True if everything arrives at once."""
        return not (self.latency or self.jitter or self.dropouts)


PERFECT: Final = Transmission.model_construct()  # the transmission without delay and losses


class Line(Generic[Message]):
    """The messages that are on their way from one sender.

    A message that is sent at time t arrives at the first physics step at or after t + latency + jitter * u, where u is
    drawn uniformly from [0, 1). It never overtakes an earlier one: it arrives at the same step at the earliest. It is
    lost with the probability `dropouts`. Two numbers are drawn for each message in any case, so that a change of one
    key does not change the draws of another. `first_sent, first_arrival, first_lost`: the physics steps of the first
    message, of the first arrival, and of the first loss; inf without one.
    """

    def __init__(self, spec: Transmission, rate: float, random: Generator) -> None:
        """Open an empty line; `rate`: physics steps per second, `random`: its own stream of random numbers."""
        self.sent = self.lost = 0
        self.first_sent = self.first_arrival = self.first_lost = math.inf
        self._spec, self._rate, self._random = spec, rate, random
        self._waiting = deque[tuple[int, Message]]()
        self._last_arrival = 0

    @property
    def next_step(self) -> float:
        """The physics step of the next arrival; inf if no message is on its way."""
        return self._waiting[0][0] if self._waiting else math.inf

    def send(self, step: int, message: Message) -> bool:
        """Send a message at a physics step. Return False if it is lost."""
        luck, share = self._random.random(2).tolist()
        self.sent += 1
        self.first_sent = min(self.first_sent, step)
        if luck < self._spec.dropouts:
            self.lost += 1
            self.first_lost = min(self.first_lost, step)
            return False
        delay = first_step(self._spec.latency + share * self._spec.jitter, self._rate)
        self._last_arrival = max(self._last_arrival, step + delay)
        self.first_arrival = min(self.first_arrival, self._last_arrival)
        self._waiting.append((self._last_arrival, message))
        return True

    def drop(self) -> None:
        """Forget the messages that are on their way."""
        self._waiting.clear()

    def time_marks(self, sender: str) -> Iterator[TimeMark]:
        """Yield the mark of the first loss, see `Transmission.time_marks`."""
        if self.lost:
            time = self.first_lost / self._rate
            yield TimeMark(time, time, f"the first message of {sender} was lost")

    def arrived(self, step: int) -> list[Message]:
        """Remove the messages that have arrived by a physics step, and return them in their order."""
        messages = []
        while self._waiting and self._waiting[0][0] <= step:
            messages.append(self._waiting.popleft()[1])
        return messages
