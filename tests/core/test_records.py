from __future__ import annotations

import copy
import dataclasses
import inspect
import pickle
from collections.abc import Callable
from typing import Any, ClassVar

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel

from sim_action.core import records
from tests.soak import examples

OPTIONS = [
    {"frozen": frozen, "slots": slots, "eq": eq}
    for frozen in (False, True)
    for slots in (False, True)
    for eq in (False, True)
]
FIELDS: dict[str, Callable[[], Any]] = {
    "none": lambda: dataclasses.MISSING,
    "default": lambda: 7,
    "field": lambda: dataclasses.field(default=8, repr=False),
    "not compared": lambda: dataclasses.field(default=9, compare=False),
    "factory": lambda: dataclasses.field(default_factory=list),
    "not taken": lambda: dataclasses.field(default_factory=list, init=False, repr=False, compare=False),
    "never set": lambda: dataclasses.field(init=False, repr=False, compare=False),
}


def both(kinds: list[str], options: dict[str, bool]) -> tuple[type, type]:
    """Return the same class made by the standard library, and by ours."""

    return dataclasses.dataclass(**options)(type("C", (), body(kinds))), made(kinds, **options)


def made(kinds: list[str], **options: bool) -> Any:
    """Return a class made by ours."""
    make: Any = records.dataclass
    return make(**options)(type("C", (), body(kinds)))


def body(kinds: list[str]) -> dict[str, Any]:
    """Return the content of a class with fields of these kinds."""
    defaults = {f"f{number}": FIELDS[kind]() for number, kind in enumerate(kinds)}
    kept = {name: value for name, value in defaults.items() if value is not dataclasses.MISSING}
    return {"__annotations__": dict.fromkeys(defaults, "object"), "__module__": __name__, "__doc__": "D", **kept}


def result(call: Callable[[], Any]) -> Any:
    try:
        return call()
    except (TypeError, AttributeError, ValueError) as error:
        return "wrong argument" if isinstance(error, TypeError | ValueError) else type(error)


@examples(40)
@given(
    st.lists(st.sampled_from(sorted(FIELDS)), max_size=4),
    st.sampled_from(OPTIONS),
    st.lists(st.integers(0, 2), max_size=4),
    st.lists(st.integers(0, 2), max_size=4),
)
def test_a_record_is_what_the_standard_library_makes(
    kinds: list[str], options: dict[str, bool], first: list[int], second: list[int]
) -> None:
    kinds = sorted(kinds, key=lambda kind: kind not in ("none", "never set"))
    standard, ours = both(kinds, options)
    assert facts(ours, first, second) == facts(standard, first, second)


def facts(cls: Any, first: list[int], second: list[int]) -> list[Any]:
    a, b = result(lambda: cls(*first)), result(lambda: cls(*second))
    of_class = [
        cls.__match_args__,
        str(inspect.signature(cls)),
        [(each.name, each.type, each.init, each.repr, each.compare) for each in dataclasses.fields(cls)],
        cls.__dataclass_params__.frozen,
        getattr(cls, "__slots__", None),
    ]
    if not isinstance(a, cls) or not isinstance(b, cls):
        return [*of_class, type(a).__name__, type(b).__name__]
    compared = cls.__dataclass_params__.eq
    return [
        *of_class,
        result(lambda: repr(a)),
        result(lambda: a == b),
        result(lambda: a != b),
        result(lambda: a == object()),
        result(lambda: hash(a)) if compared else None,
        result(lambda: setattr(a, "f0", 5)),
        result(lambda: setattr(a, "other", 5)) if "__slots__" not in vars(cls) else None,
        result(lambda: vars_of(dataclasses.replace(b, f0=3))),
        result(lambda: vars_of((records if hasattr(cls, "__record__") else dataclasses).replace(b, f0=3))),
        result(lambda: vars_of(copy.copy(b))),
        result(lambda: vars_of(b)),
        result(lambda: delattr(a, "f0")),
    ]


def vars_of(instance: Any) -> list[Any]:
    return [getattr(instance, each.name, "none") for each in dataclasses.fields(instance)]


@records.dataclass(frozen=True, slots=True)
class Point:
    x: float
    y: float = 0.0
    unit: ClassVar[str] = "m"

    def doubled(self) -> Point:
        return dataclasses.replace(self, x=2 * self.x)


@records.dataclass(frozen=True, slots=True)
class Named(Point):
    name: str = "n"


@records.dataclass(frozen=True)
class Checked:
    size: int

    def __post_init__(self) -> None:
        if self.size < 0:
            raise ValueError(self.size)

    def __hash__(self) -> int:
        return 5


class Model(BaseModel):
    at: Point


def test_records_inherit_are_pickled_and_take_part_in_patterns_and_models() -> None:
    assert repr(Named(1, 2, "a")) == "Named(x=1, y=2, name='a')"
    assert [*Named.__slots__] == ["name"]
    assert Named(1, 2) != Point(1, 2)
    assert (Point(1).unit, [each.name for each in dataclasses.fields(Point)]) == ("m", ["x", "y"])  # not ClassVar
    assert pickle.loads(pickle.dumps(Named(1, 2, "a"))) == Named(1, 2, "a")
    assert Point(1).doubled() == Point(2)
    assert hash(Checked(1)) == 5
    with pytest.raises(ValueError, match="-1"):
        Checked(-1)
    match Point(1, 2):
        case Point(x, y):
            assert (x, y) == (1, 2)
    assert Model.model_validate({"at": {"x": 1, "y": 2}}).at == Point(1, 2)
    assert Model(at=Point(3)).model_dump() == {"at": {"x": 3, "y": 0.0}}


def test_nothing_is_compiled_before_use_and_unknown_arguments_are_refused() -> None:
    make: Any = records.dataclass
    cls = make(frozen=True)(type("C", (), {"__annotations__": {"a": "int"}}))
    assert not inspect.isfunction(vars(cls)["__init__"])
    assert cls(3).a == 3
    assert inspect.isfunction(vars(cls)["__init__"])
    with pytest.raises(TypeError, match=r"Point\.__init__\(\) got an unexpected keyword argument 'z'"):
        Point(1, z=2)  # type: ignore[call-arg]  # the test is about it


def test_a_class_without_a_decorator_extends_a_record() -> None:
    @records.dataclass(frozen=True)
    class Base:
        a: int

    @records.dataclass(frozen=True)
    class Derived(Base):
        b: int = 2

    class Extended(Derived):
        def __init__(self, a: int, note: str) -> None:
            super().__init__(a)
            self.note = note

    extended = Extended(1, "n")
    assert (extended.a, extended.b, extended.note) == (1, 2, "n")
    del extended.note
    for name in ("a", "b"):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(extended, name, 3)
        with pytest.raises(dataclasses.FrozenInstanceError):
            delattr(extended, name)
    with pytest.raises(dataclasses.FrozenInstanceError):
        Derived(1).note = "n"  # type: ignore[attr-defined]  # the test is about it


def test_instances_share_no_default_that_can_change() -> None:
    @records.dataclass()
    class Shared:
        a: list[int] = []  # noqa: RUF012 - the test is about it

    with pytest.raises(ValueError, match="use default_factory"):
        Shared()


@pytest.mark.parametrize("kind", ["default", "field", "factory"])
def test_a_required_field_after_an_optional_one_is_refused_where_it_is_defined(kind: str) -> None:
    with pytest.raises(TypeError, match=r"^f1, without a default, follows f0, which has one$"):
        made([kind, "none"])
    assert made(["not taken", "none"])(3).f1 == 3


def test_a_required_field_after_an_inherited_optional_one_is_refused() -> None:
    base = made(["default"])
    with pytest.raises(TypeError, match=r"^own, without a default, follows f0, which has one$"):
        records.dataclass()(type("Derived", (base,), {"__annotations__": {"own": "object"}}))


def test_a_copy_with_other_values_is_also_made_as_python_3_13_does() -> None:
    @records.dataclass(frozen=True)
    class Record:
        a: int = 1

    changed: Any = Record()
    assert changed.__replace__(a=2) == Record(2)
