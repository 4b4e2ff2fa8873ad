"""Packed parts: what was added comes back, in its order, however long it is."""

from __future__ import annotations

from sim_action.reports.junit import PackedParts


def test_what_was_added_comes_back_in_its_order() -> None:
    parts, added = PackedParts(), [str(number).encode() * 50_000 for number in range(30)]
    assert not b"".join(parts)
    for part in added:
        parts.add(part)
    assert b"".join(parts) == b"".join(parts) == b"".join(added)
