"""Records: `dataclass` of the standard library without its cost when a module is imported.

The standard decorator compiles six functions per class, used or not: a fifth of the time of a short run. This one
compiles `__init__` when the first instance is made; the other methods are the same for all classes.
"""

from __future__ import annotations

import dataclasses
from dataclasses import MISSING, Field, FrozenInstanceError, field
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from dataclasses import dataclass, replace
else:

    def dataclass(*, frozen: bool = False, slots: bool = False, eq: bool = True) -> Callable[[type], type]:
        """Make a class of plain data, as `dataclasses.dataclass` with these options does."""
        return lambda cls: _made(cls, frozen=frozen, slots=slots, eq=eq)

    def replace(instance: Any, /, **changes: Any) -> Any:
        """Return a copy of a record with other values of some fields, as `dataclasses.replace` does."""
        record = instance.__record__
        for name in record.arguments:
            if name not in changes:
                changes[name] = getattr(instance, name)
        return instance.__class__(**changes)


__all__ = ["dataclass", "delegated", "field", "replace"]
_NO_FIELDS: Final = ("ClassVar", "typing.ClassVar")
_OF_INSTANCES: Final = ("__dict__", "__weakref__")


def delegated(path: str) -> Any:
    """Return a property that a part answers, such as "bounds.state" for the state of the field `bounds`."""
    return property(attrgetter(path))


class _Record:
    """The description of a record class.

    Attributes:
        fields: name -> its default value, its `field(...)`, or MISSING; fields of base classes come first.
        types: name -> its annotation.
        key: returns the values of an instance that are compared.
        shown: the fields in `repr`.
        arguments: the fields that `__init__` takes.
    """

    __slots__ = ("arguments", "eq", "fields", "frozen", "key", "shown", "types")

    def __init__(self, cls: type, own: Mapping[str, Any], *, frozen: bool, eq: bool) -> None:
        self.fields: dict[str, Any] = {}
        self.types: dict[str, Any] = {}
        for base in reversed(cls.__mro__):
            if (inherited := base.__dict__.get("__record__")) is not None:
                self.fields |= inherited.fields
                self.types |= inherited.types
        self.fields |= own
        self.types |= {name: cls.__annotations__[name] for name in own}
        self.frozen, self.eq = frozen, eq
        self.shown = [name for name, default in self.fields.items() if not _is_field(default) or default.repr]
        self.arguments = tuple(name for name, default in self.fields.items() if not _is_field(default) or default.init)
        compared = [name for name, default in self.fields.items() if not _is_field(default) or default.compare]
        self.key = _tuple_of(compared)
        optional = ""
        for name in self.arguments:
            if not _is_required(self.fields[name]):
                optional = name
            elif optional:
                raise TypeError(f"{name}, without a default, follows {optional}, which has one")


def _is_required(default: object) -> bool:
    if not isinstance(default, Field):
        return default is MISSING
    return default.default is MISSING and default.default_factory is MISSING


def _is_field(default: object) -> bool:
    return isinstance(default, Field)


def _tuple_of(names: list[str]) -> Callable[[object], tuple[Any, ...]]:
    if len(names) > 1:
        return attrgetter(*names)
    return lambda instance: tuple(getattr(instance, name) for name in names)


class _Absent:
    """The default of a parameter whose value a factory makes."""

    def __repr__(self) -> str:
        return "<factory>"


_ABSENT: Final = _Absent()


class _LaterInit:
    """The method `__init__` of a class, compiled at its first call; `super().__init__` finds another one."""

    def __init__(self, cls: type) -> None:
        self._cls = cls

    def __get__(self, instance: object, owner: type) -> Any:
        made: Any = _init(self._cls, self._cls.__dict__["__record__"])
        type.__setattr__(self._cls, "__init__", made)
        return made if instance is None else made.__get__(instance, owner)


class _Later:
    """An attribute of a class that is made when it is first used."""

    def __init__(self, name: str, make: Callable[[type, _Record], Any]) -> None:
        self._name, self._make = name, make

    def __get__(self, instance: object, owner: type) -> Any:
        for cls in owner.__mro__:
            if cls.__dict__.get(self._name) is self:
                setattr(cls, self._name, self._make(cls, cls.__dict__["__record__"]))
        return getattr(owner if instance is None else instance, self._name)


def _init(cls: type, record: _Record) -> Callable[..., None]:
    """Return the method `__init__` of a class."""
    names: dict[str, Any] = {"_set": object.__setattr__, "_absent": _ABSENT}
    parameters, lines = ["self"], []
    for name, stated in record.fields.items():
        definition: Field[Any] = stated if _is_field(stated) else field(default=stated)
        value = name
        if definition.default is not MISSING:
            if definition.default.__class__.__hash__ is None:
                raise ValueError(f"all instances would share the default of {name}: use default_factory")
            names[f"_default_{name}"] = definition.default
            parameter = f"{name}=_default_{name}"
        elif definition.default_factory is not MISSING:
            names[f"_make_{name}"] = definition.default_factory
            parameter = f"{name}=_absent"
            value = f"_make_{name}() if {name} is _absent else {name}" if definition.init else f"_make_{name}()"
        elif not definition.init:
            # `__post_init__` sets it.
            continue
        else:
            parameter = name
        if definition.init:
            parameters.append(parameter)
        lines.append(f"_set(self, {name!r}, {value})" if record.frozen else f"self.{name} = {value}")
    if hasattr(cls, "__post_init__"):
        lines.append("self.__post_init__()")
    body = "\n ".join(lines or ["pass"])
    exec(f"def __init__({', '.join(parameters)}):\n {body}", names)  # noqa: S102 - made of names of fields only
    init: Callable[..., None] = names["__init__"]
    init.__annotations__ = {name: record.types[name] for name in record.arguments} | {"return": None}
    init.__module__, init.__qualname__ = cls.__module__, f"{cls.__qualname__}.__init__"
    return init


def _fields(cls: type, record: _Record) -> Any:
    """Return the attribute by which the standard library knows the fields of a class."""
    defaults = {name: default for name, default in record.fields.items() if default is not MISSING}
    bare = type(cls.__name__, (), {"__annotations__": record.types, "__module__": cls.__module__, **defaults})
    made: Any = dataclasses.dataclass(init=False, repr=False, eq=False, match_args=False)(bare)
    return made.__dataclass_fields__


def _params(cls: type, record: _Record) -> Any:
    made: Any = dataclasses.dataclass(frozen=record.frozen, eq=record.eq)(type(cls.__name__, (), {}))
    return made.__dataclass_params__


def _repr(self: Any) -> str:
    shown = ", ".join(f"{name}={getattr(self, name)!r}" for name in self.__record__.shown)
    return f"{type(self).__qualname__}({shown})"


def _eq(self: Any, other: Any) -> Any:
    if other.__class__ is not self.__class__:
        return NotImplemented
    key = self.__record__.key
    return key(self) == key(other)


def _hash(self: Any) -> int:
    return hash(self.__record__.key(self))


def _set(self: Any, name: str, value: object) -> None:
    if _is_frozen(self, name):
        raise FrozenInstanceError(f"cannot assign to field {name!r}")
    object.__setattr__(self, name, value)


def _delete(self: Any, name: str) -> None:
    if _is_frozen(self, name):
        raise FrozenInstanceError(f"cannot delete field {name!r}")
    object.__delattr__(self, name)


def _is_frozen(instance: Any, name: str) -> bool:
    return "__record__" in type(instance).__dict__ or name in instance.__record__.fields


def _state(self: Any) -> list[Any]:
    return [getattr(self, name) for name in self.__record__.fields]


def _restore(self: Any, state: list[Any]) -> None:
    for name, value in zip(self.__record__.fields, state, strict=True):
        object.__setattr__(self, name, value)


_METHODS: Final = {
    "__repr__": _repr,
    "__replace__": replace,
    "__dataclass_fields__": _Later("__dataclass_fields__", _fields),
    "__dataclass_params__": _Later("__dataclass_params__", _params),
}
_OF_FROZEN: Final = {"__setattr__": _set, "__delattr__": _delete}
_OF_FROZEN_SLOTS: Final = {"__getstate__": _state, "__setstate__": _restore}


def _made(cls: type, *, frozen: bool, slots: bool, eq: bool) -> type:
    own = {
        name: cls.__dict__.get(name, MISSING)
        for name, annotation in cls.__annotations__.items()
        if not str(annotation).startswith(_NO_FIELDS)
    }
    record = _Record(cls, own, frozen=frozen, eq=eq)
    methods: dict[str, Any] = {**_METHODS, "__match_args__": record.arguments, "__record__": record}
    if eq:
        methods |= {"__eq__": _eq, "__hash__": _hash if frozen else None}
    if frozen:
        methods |= _OF_FROZEN
        if slots:
            methods |= _OF_FROZEN_SLOTS
    stated = cls.__dict__
    # Python adds a `__hash__` of None to a class with an `__eq__` of its own.
    added = {name: method for name, method in methods.items() if stated.get(name) is None}
    made = _with_slots(cls, own, added) if slots else _without_slots(cls, own, added)
    if "__init__" not in stated:
        type.__setattr__(made, "__init__", _LaterInit(made))
    return made


def _without_slots(cls: type, own: Mapping[str, Any], added: Mapping[str, Any]) -> type:
    for name, default in own.items():
        if _is_field(default) and default.default is MISSING:
            delattr(cls, name)
        elif _is_field(default):
            setattr(cls, name, default.default)
    for name, method in added.items():
        setattr(cls, name, method)
    return cls


def _with_slots(cls: type, own: Mapping[str, Any], added: Mapping[str, Any]) -> type:
    """Return a copy of a class whose fields are slots."""
    kept = {
        name: attribute for name, attribute in cls.__dict__.items() if name not in own and name not in _OF_INSTANCES
    }
    inherited = {name for base in cls.__mro__[1:] for name in base.__dict__.get("__slots__", ())}
    free = tuple(name for name in own if name not in inherited)
    made = type(cls)(cls.__name__, cls.__bases__, {**kept, **added, "__slots__": free})
    made.__qualname__ = cls.__qualname__
    return made
