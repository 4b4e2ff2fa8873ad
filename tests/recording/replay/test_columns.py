from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sim_action.recording.replay.columns import MAX_DELTA, Column, FloatArray, TextColumn, fine_scale

lengths = st.integers(1, 60)
ordinary = st.floats(-1e6, 1e6)
anything = st.floats(allow_nan=True, allow_infinity=True)


@given(lengths.flatmap(lambda n: arrays(np.float64, n, elements=ordinary)), st.sampled_from([1e-4, 1e-3, 1.0, 1 / 240]))
def test_decoding_gives_back_what_was_encoded_to_half_a_step(values: FloatArray, scale: float) -> None:
    column = Column.encoded(values, scale)
    found = Column.model_validate_json(column.model_dump_json()).decoded(len(values))
    assert np.abs(found - values).max() <= scale * 0.5 + 1e-9


@given(lengths.flatmap(lambda n: arrays(np.float64, n, elements=anything)))
def test_what_is_not_finite_is_a_gap_and_nothing_else_is(values: FloatArray) -> None:
    column = Column.encoded(values, 1e-3)
    found = Column.model_validate_json(column.model_dump_json()).decoded(len(values))
    assert (np.isfinite(found) == np.isfinite(values)).all()


@pytest.mark.parametrize("value", [1e308, -1e308, 5e-324])
def test_what_is_beyond_everything_is_a_number(value: float) -> None:
    column = Column.encoded(np.array([0.0, value]), 1e-3)
    assert Column.model_validate_json(column.model_dump_json()).fits(2)
    assert np.isfinite(column.decoded(2)).all()


def test_what_never_changes_and_what_is_before_a_gap() -> None:
    # What never changes has no deltas.
    column = Column.encoded(np.full(900, 0.25), 1e-3)
    assert (column.first, column.deltas) == (250, ())
    assert column.decoded(900).tolist() == [0.25] * 900
    # Values within half a step before a gap are kept after it.
    values = np.array([np.nan, 1.0, np.nan, np.nan, 2.0])
    column = Column.encoded(values, 0.5)
    assert column.gaps == ((0, 1), (2, 2))
    assert column.deltas == (0, 0, 0, 2)


@given(lengths.flatmap(lambda n: arrays(np.float64, n, elements=ordinary)))
def test_a_fine_scale_tells_two_thousand_steps_apart(values: FloatArray) -> None:
    span = float(np.ptp(values)) or float(np.abs(values).max())
    assert not span > 1e-200 or span / fine_scale(values) >= 2_000 * (1 - 1e-9)


@pytest.mark.parametrize(
    ("values", "scale"),
    [
        ([0.0, 1.0], 1e-4),
        ([5.0, 7.0], 1e-3),
        ([-3.0, -3.0], 1e-3),
        ([np.nan, 0.0, 1.0, np.inf], 1e-4),
        ([0.0, 0.0], 1e-6),
        ([np.nan], 1e-6),
        ([0.0, 1e-250], 1e-6),
        ([0.0, 1e250], 1e-6),
    ],
)
def test_a_fine_scale_is_a_power_of_ten(values: list[float], scale: float) -> None:
    assert fine_scale(np.array(values)) == pytest.approx(scale)


def test_the_number_of_moments_of_a_column() -> None:
    # A column fits its own number of moments alone.
    column = Column(scale=1.0, first=0, deltas=(1, 2), gaps=((1, 2),))
    assert column.fits(3)
    assert not column.fits(4)
    assert not Column(scale=1.0, first=0, gaps=((1, 2),)).fits(2)
    # Text of another length does not fit.
    assert not TextColumn(scale=1.0, first=0, deltas="$$").fits(4)
    assert not TextColumn(scale=1.0, first=0, gaps=((1, 4),)).fits(4)


@given(lengths.flatmap(lambda n: arrays(np.float64, n, elements=ordinary)))
def test_a_column_of_text_gives_back_what_was_encoded(values: FloatArray) -> None:
    scale = fine_scale(values)
    column = TextColumn.encoded(values, scale)
    found = TextColumn.model_validate_json(column.model_dump_json())
    assert found == column
    assert found.fits(len(values))
    assert np.abs(found.decoded(len(values)) - values).max() <= scale * 0.5 + 1e-9


def test_gaps_and_large_differences_in_a_column_of_text() -> None:
    # A column of text has gaps.
    column = TextColumn.encoded(np.array([np.nan, 1.0, np.inf, 2.0]), 0.5)
    np.testing.assert_array_equal(column.decoded(4), [np.nan, 1.0, np.nan, 2.0])
    assert (column.deltas, column.gaps) == ("  $", ((0, 1), (2, 1)))
    assert TextColumn.encoded(np.array([0.0, 1e9]), 1.0).decoded(2).tolist() == [0, MAX_DELTA]


@pytest.mark.parametrize(
    ("deltas", "gaps", "rises"),
    [("$&", (), True), ("$ ", (), False), ("$!", (), False), ("\x10", (), False), ("$", ((0, 1),), False)],
)
def test_a_column_of_text_knows_if_it_rises(deltas: str, gaps: tuple[tuple[int, int], ...], *, rises: bool) -> None:
    assert TextColumn(scale=1.0, first=0, deltas=deltas, gaps=gaps).rises == rises
