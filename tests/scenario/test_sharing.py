"""Sharing: what is shared is equal in every bit, and nothing of either object changes."""

from __future__ import annotations

import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.field_types import FrozenModel
from sim_action.core.records import dataclass, replace
from sim_action.scenario.sharing import share_parts
from tests.soak import examples


class Part(FrozenModel):
    """A part of a model."""

    name: str = ""
    values: tuple[float | int | bool | str | None, ...] = ()


@dataclass(frozen=True, slots=True)
class Place:
    """A frozen record in a model."""

    file: str
    line: int | None = None
    parts: tuple[Part, ...] = ()


class Whole(FrozenModel):
    """A model with parts."""

    part: Part
    places: tuple[Place, ...] = ()
    number: float = 0.0


plain = st.sampled_from([None, False, True, -1, 0, 1, "", "a", "b" * 40, 0.0, -0.0, 1.0])
parts = st.builds(Part, name=st.sampled_from(["a", "b"]), values=st.lists(plain, max_size=3).map(tuple)) | st.just(
    Part()
)
places = st.builds(Place, st.sampled_from(["x", "y"]), st.integers(0, 1), st.lists(parts, max_size=2).map(tuple))
wholes = st.builds(
    Whole, part=parts, places=st.lists(places, max_size=3).map(tuple), number=st.sampled_from([0.0, -0.0])
)


def copied(value: Whole) -> Whole:
    return pickle.loads(pickle.dumps(value))  # type: ignore[no-any-return]


def shown(value: Whole) -> str:
    return f"{value!r} {value.model_dump_json(exclude_unset=True)}"


@examples(40)
@given(wholes, wholes)
def test_an_object_that_shares_parts_is_what_it_was(new: Whole, known: Whole) -> None:
    before, like = shown(new), shown(known)
    found = share_parts(copied(new), known)
    assert shown(found) == before
    assert shown(known) == like


@examples(20)
@given(wholes)
def test_an_equal_object_is_replaced(whole: Whole) -> None:
    assert share_parts(copied(whole), whole) is whole


def test_the_parts_that_are_equal_are_one() -> None:
    known = Whole(part=Part(name="a", values=(1.5,)), places=(Place("long", 1), Place("other", 2)))
    new = copied(known.model_copy(update={"places": (Place("long", 1), Place("new", 2)), "number": 2.0}))
    found = share_parts(new, known)
    assert found is new
    assert found.part is known.part
    assert found.places[0] is known.places[0]
    assert found.places[1] == Place("new", 2)


@pytest.mark.parametrize(
    ("new", "known"),
    [(1, 1.0), (True, 1), (0.0, -0.0), (Place("a"), Place("b")), ((1,), (1, 2)), ("a", None), ([], [])],
)
def test_values_of_other_types_or_signs_are_not_shared(new: object, known: object) -> None:
    assert share_parts(new, known) is new


def test_of_dictionaries_only_empty_ones_are_shared_and_what_differs_in_the_middle_is_kept() -> None:
    dictionaries: list[dict[str, int]] = [{}, {"a": 1}]
    assert share_parts({}, dictionaries[0]) is dictionaries[0]
    other = {"a": 1}
    assert share_parts(other, dictionaries[1]) is other
    known = Place("a", 1, (Part(name="a"), Part(name="b")))
    new = replace(known, parts=(Part(name="a"), Part(name="c"), Part(name="b")))
    assert share_parts(new, known).parts == (Part(name="a"), Part(name="c"), Part(name="b"))
