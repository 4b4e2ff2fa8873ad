from __future__ import annotations

from pathlib import Path

import pytest

from sim_action.runner import job
from sim_action.runner.job import OutcomeWriter


def test_a_later_outcome_replaces_the_earlier(tmp_path: Path) -> None:
    writer = OutcomeWriter(tmp_path / "outcome.json")
    writer.write(b"first")
    writer.write(b"second")
    assert (tmp_path / "outcome.json").read_bytes() == b"second"
    assert len(list(tmp_path.iterdir())) == 1


def test_an_outcome_that_is_too_large_leaves_the_earlier(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(job, "MAX_OUTCOME_BYTES", 10)
    writer = OutcomeWriter(tmp_path / "outcome.json")
    writer.write(b"first")
    with pytest.raises(ValueError, match="the outcome is larger than"):
        writer.write(b"x" * 11)
    assert (tmp_path / "outcome.json").read_bytes() == b"first"
