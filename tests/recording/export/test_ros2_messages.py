"""CDR, against an encoder that others wrote."""

from __future__ import annotations

import struct
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap_ros2._dynamic import serialize_dynamic
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from sim_action.recording.export.ros2_messages import _FIELDS, CdrForm, definition, full_name

DEFINITION = "string name\nuint8 flag\nfloat64[] values\nstring[] words\nfloat32 ratio\nint32 count\nfloat64 last\n"
FLOATS = st.floats(allow_nan=False, width=32)
TEXTS = st.text(st.characters(exclude_characters="\0", codec="utf-8"), max_size=9)


@given(
    TEXTS,
    st.integers(0, 255),
    st.lists(st.tuples(FLOATS, FLOATS), min_size=1, max_size=3),
    st.lists(TEXTS, max_size=3),
    st.lists(FLOATS, max_size=3),
)
def test_it_is_what_others_make_of_the_same_message(
    name: str, flag: int, pairs: list[tuple[float, float]], words: list[str], values: list[float]
) -> None:
    form = CdrForm().string(name).fixed("u1", flag).fixed("<u4", len(values)).gap("<f8", len(values))
    form.strings(*words).gap("<f4").fixed("<i4", -7).gap("<f8")
    ratios, lasts = zip(*pairs, strict=True)
    columns: list[Any] = [np.tile(values, (len(pairs), 1))] if values else []
    encode: Any = serialize_dynamic("a/B", DEFINITION)["a/B"]
    expected = [
        encode(SimpleNamespace(name=name, flag=flag, values=values, words=words, ratio=ratio, count=-7, last=last))
        for ratio, last in pairs
    ]
    assert form.filled(len(pairs), *columns, ratios, lasts) == expected


def test_numbers_and_texts_of_a_message() -> None:
    # Numbers lie at multiples of their size.
    (message,) = CdrForm().fixed("u1", 1).gap("<f8").filled(1, [2.5])
    assert message == b"\0\1\0\0" + b"\1" + bytes(7) + struct.pack("<d", 2.5)
    assert CdrForm().string("a\0b\ud800").filled(1) == CdrForm().string("ab?").filled(1)


@pytest.mark.parametrize("name", _FIELDS)
def test_each_type_and_all_that_it_is_made_of_is_that_of_ros(name: str) -> None:
    told = get_types_from_msg(definition(name), full_name(name))
    theirs = get_typestore(Stores.ROS2_HUMBLE).fielddefs
    assert full_name(name) in told
    for found, (_, fields) in told.items():
        assert fields == theirs[found][1], found
