"""The contacts of the last observation that was made: read when they are looked at, or before the engine goes on."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from weakref import ref

from sim_action.state.observation import Contact, PresentContacts


class Glance:
    """Most controllers do not look at contacts, and most let go of an observation before the next one."""

    def __init__(self) -> None:
        self._last: ref[PresentContacts] | None = None

    def at(self, read: Callable[[], Iterable[Contact]]) -> PresentContacts:
        """Contacts of the present, which `read` would read now."""
        self.settle()
        present = PresentContacts(read)
        self._last = ref(present)
        return present

    def settle(self) -> None:
        """Before the engine goes on: whoever still holds them, and has not looked, is to see what they are now."""
        if self._last is not None:
            held = self._last()
            if held is not None:
                held.settle()
            self._last = None
