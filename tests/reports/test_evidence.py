"""The curve that a verdict is about, out of the file that a run has left."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim_action.recording.replay.models import Replay
from sim_action.recording.replay.storage import write
from sim_action.reports import ReportOptions
from sim_action.reports.evidence import curve, replay_of
from sim_action.results.file import Results
from sim_action.state.verdict import Verdict
from tests.reports.replays import replay, signal

Samples = dict[str, Results]

SHORT = Verdict(False, 1.12, 1.5, -0.38, "m", 3.0)


def stored(options: ReportOptions, made: Replay, name: str = "replays/a.json.gz") -> str:
    write(made, options.folder / name)
    return name


def test_what_a_run_has_left_is_read(samples: Samples, options: ReportOptions) -> None:
    made = replay(signal("travelled", [0.0, 1.0, 1.12, 1.12], lower=1.5))
    outcome = samples["passed"].outcomes[0].model_copy(update={"replay": stored(options, made)})
    assert replay_of(outcome, options) == made


def test_what_has_left_nothing_has_no_curves(samples: Samples, options: ReportOptions) -> None:
    assert replay_of(samples["passed"].outcomes[0], options) is None


@pytest.mark.parametrize("name", ["../a.json.gz", "replays/none.json.gz", "/etc/passwd", "replays/\0"])
def test_a_file_from_elsewhere_is_not_read(name: str, samples: Samples, options: ReportOptions) -> None:
    stored(options, replay(), "../a.json.gz")
    assert replay_of(samples["passed"].outcomes[0].model_copy(update={"replay": name}), options) is None


def test_a_file_that_is_no_replay_is_none(samples: Samples, options: ReportOptions) -> None:
    (options.folder / "replays").mkdir(parents=True)
    (options.folder / "replays/a.json.gz").write_bytes(b"not a replay")
    outcome = samples["passed"].outcomes[0].model_copy(update={"replay": "replays/a.json.gz"})
    assert replay_of(outcome, options) is None


def test_a_curve_is_as_it_was_stored() -> None:
    found = curve(replay(signal("travelled", [0.0, 1.0, 1.12, 1.12], lower=1.5)), 0, SHORT)
    assert found is not None
    assert (found.name, found.unit, found.lower, found.upper, found.start) == ("travelled", "m", 1.5, None, 0.0)
    np.testing.assert_allclose(found.time, [0.0, 1.0, 2.0, 3.0])
    np.testing.assert_allclose(found.values, [0.0, 1.0, 1.12, 1.12])


def test_a_curve_may_have_moments_of_its_own() -> None:
    found = curve(replay(signal("travelled", [0.0, 1.0], time=[0.5, 0.75])), 0, SHORT)
    assert found is not None
    np.testing.assert_allclose(found.time, [0.5, 0.75])


def test_of_several_it_is_the_one_with_the_unit_the_limit_and_the_value() -> None:
    x = signal("x", [0.0, 1.0, 2.0, 3.0], lower=1.5)
    seconds = signal("time at rest", [0.0, 1.0, 1.12, 1.12], unit="s", lower=1.5)
    other = signal("y", [0.0, 1.0, 1.12, 1.12], lower=1.6)
    wanted = signal("travelled", [0.0, 1.0, 1.12, 1.12], lower=1.5)
    found = curve(replay(x, seconds, other, wanted), 0, SHORT)
    assert found is not None
    assert found.name == "travelled"


def test_of_none_that_fits_it_is_the_first() -> None:
    found = curve(replay(signal("x", [0.0] * 4), signal("y", [0.0] * 4)), 0, replace(SHORT, measured=None, limit=None))
    assert found is not None
    assert found.name == "x"


def test_curves_belong_to_one_expectation() -> None:
    assert curve(replay(signal("x", [0.0] * 4, expectation=1)), 0, SHORT) is None


def test_a_replay_without_values_is_no_error(tmp_path: Path) -> None:
    found = curve(replay(signal("x", [np.nan] * 4)), 0, SHORT)
    assert found is not None
    assert np.isnan(found.values).all()
