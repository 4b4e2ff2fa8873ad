"""Evidence that cannot be written is a note that says why."""

from __future__ import annotations

import errno

import pytest

from sim_action.runner.evidence import _noted


@pytest.mark.parametrize(
    ("error", "note"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), "replay: no space left on device"),
        (MemoryError(), "replay: out of memory"),
        (ValueError("Too large"), "replay: too large"),
        (KeyError("box"), "replay: an internal error of sim-action: KeyError: 'box'; please report it"),
    ],
)
def test_an_error_is_a_note_with_its_reason(error: Exception, note: str) -> None:
    notes: list[str] = []
    with _noted("replay", notes):
        raise error
    assert notes == [note]
