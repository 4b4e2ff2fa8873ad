"""Small .npz files are those of numpy."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from sim_action.state.npz_file import packed, save_arrays
from tests.soak import examples

KINDS = st.one_of(
    arrays.floating_dtypes(), arrays.integer_dtypes(), arrays.boolean_dtypes(), arrays.unicode_string_dtypes()
)
NAMES = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0/\\"), min_size=1, max_size=12)


def of_numpy(named: dict[str, Any]) -> bytes:
    file = io.BytesIO()
    np.savez(file, **named)
    return file.getvalue()


@examples(100)
@given(
    st.dictionaries(
        NAMES.filter(lambda name: name not in {"file", "allow_pickle"}),
        arrays.arrays(KINDS, arrays.array_shapes(min_dims=0, min_side=0)),
        max_size=5,
    )
)
def test_the_bytes_are_those_of_numpy(named: dict[str, Any]) -> None:
    assert packed(named) == of_numpy(named)


@pytest.mark.parametrize(
    "array",
    [
        pytest.param(np.arange(12.0).reshape(3, 4)[:, 1:3], id="columns of a table"),
        pytest.param(np.arange(12.0).reshape(3, 4).T, id="stored by columns"),
        pytest.param(np.asfortranarray(np.arange(24).reshape(2, 3, 4)), id="stored by columns, three axes"),
        pytest.param(np.arange(12.0)[::-2], id="backwards"),
        pytest.param(np.broadcast_to(1.5, (3, 2)), id="one number everywhere"),
        pytest.param(np.array([1.5], dtype=">f8"), id="another byte order"),
    ],
)
def test_arrays_that_are_no_row_of_memory(array: Any) -> None:
    named = {"before": np.zeros(3), "it": array}
    assert packed(named) == of_numpy(named)
    with np.load(io.BytesIO(packed(named))) as stored:
        assert np.array_equal(stored["it"], array)


@pytest.mark.parametrize("count", [3, 200_000])
def test_a_file_of_any_size_is_that_of_numpy(count: int, tmp_path: Path) -> None:
    named = {"it": np.arange(float(count))}
    save_arrays(named, tmp_path / "it.npz")
    assert (tmp_path / "it.npz").read_bytes() == of_numpy(named)
