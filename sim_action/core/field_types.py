"""The field types of a scenario: SI floats with optional units, names, poses; the base class of its models; errors.

`Metres` and its siblings are plain `float` to the code that uses them; pydantic reads them with `units.parse` and
describes them in the JSON Schema. `spec_errors` turns the findings of pydantic into sentences.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, Final, NoReturn, Self, get_args

from annotated_types import Ge, Gt, Le, Lt
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ValidationError,
    ValidationInfo,
)
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from sim_action.core import geometry, units
from sim_action.core.errors import InvalidPart, Location, Problem
from sim_action.core.records import dataclass
from sim_action.core.units import Dimension
from sim_action.core.wording import FirstFew, did_you_mean, escaped_line, shown

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails


def _built(model: Any, /, *positional: Any, **keys: Any) -> Any:
    """Return a model that Python code builds; pydantic builds the parts of a file without it. Raise InvalidPart."""
    try:
        return type(BaseModel).__call__(model, *positional, **keys)
    except ValidationError as error:
        place = Location(f"{model.__name__} (Python)")
        messages = [(".".join(map(str, path)), message) for path, message in spec_errors(model, keys, error)]
    raise InvalidPart([Problem(place, f"{key}: {message}" if key else message) for key, message in messages])


class FrozenModel(BaseModel, metaclass=type("ModelType", (type(BaseModel),), {"__call__": _built})):  # type: ignore[metaclass]  # mypy sees the type of all models
    """The base class of all parts of a scenario: immutable, strict about types, closed to unknown keys."""

    # A validator is built at its first use: most models are only parts of others. Default parts are therefore made by
    # model_construct(), which needs no validator.
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, defer_build=True)


BARE_ANGLE_RULE: Final = "bare angle rule"
"""The key, in a context of pydantic, of the rule that refuses angles without a unit beyond one turn."""

_JSON_SCHEMA_WORDS: Final = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum", "le": "maximum"}


@dataclass(frozen=True, slots=True)
class Without:
    """An annotation of a model that names the keys it does not take at this place. Documents and schemas omit them."""

    names: frozenset[str]

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        whole = handler.resolve_ref_schema(handler(schema))
        properties = {key: field_schema for key, field_schema in whole["properties"].items() if key not in self.names}
        return {**whole, "properties": properties}


@dataclass(frozen=True, slots=True)
class Quantity:
    """An annotation that makes a float a quantity of one dimension, or of one of several (for joints)."""

    dimensions: tuple[Dimension, ...]
    # the greatest angle in rad, or angular speed in rad/s, that is accepted without a unit
    most_bare: float = units.MAX_BARE_RAD

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.with_info_before_validator_function(self._read, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return self._with_unit(handler(schema))

    def _with_unit(self, number_schema: dict[str, Any]) -> dict[str, Any]:
        # pydantic keeps its own names for bounds that were added outside this annotation.
        number = {_JSON_SCHEMA_WORDS.get(key, key): value for key, value in number_schema.items()}
        symbols = [symbol for dimension in self.dimensions for symbol in dimension.factors if symbol]
        if not symbols:
            return number
        example = self.dimensions[0].example
        needs = f"number, or text such as {example}"
        unit = "|".join(symbol.replace("^", r"\^") for symbol in symbols)
        digits = r"([0-9]+[.]?[0-9]*|[.][0-9]+)([eE][-+]?[0-9]+)?"
        text = {
            "type": "string",
            "pattern": rf"(?!){needs}|^ *{_ANY_SIGN}{digits} *({unit})?{END_OF_TEXT}",
            "examples": [example],
            "description": f"{needs}; units: {', '.join(symbols)}",
        }
        return {"anyOf": [number, text]}

    def _read(self, value: object, info: ValidationInfo) -> object:
        try:
            number = units.parse(value, *self.dimensions)
        except units.UnitError as error:
            raise _refused(str(error)) from None
        rule = info.context.get(BARE_ANGLE_RULE) if info.context else None
        if rule and self.dimensions in ((units.ANGLE,), (units.ANGULAR_SPEED,)):
            problem = units.beyond_a_turn(value, self.dimensions[0].si, self.most_bare)
            if problem is not None:
                raise _refused(f"{problem} [{rule}]")
        return number


@dataclass(frozen=True)
class Written(Quantity):
    """An annotation for a quantity that keeps its written form: only the robot model determines its dimension."""

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return self._with_unit({"type": "number"})

    def _read(self, value: object, info: ValidationInfo) -> object:
        super()._read(value, info)
        return value


_ANY_SIGN: Final = "[-+]?"
_NOT_NEGATIVE: Final = "[+]?"
_POSITIVE: Final = r"[+]?(?=[0.]*[1-9])"
END_OF_TEXT: Final = r"[ \n]*$"  # the end of a pattern for text that may end with line breaks, as a YAML block does


def pattern_at_least(pattern: str, bound: float, *, exclusive: bool) -> str:
    """Return the pattern of a quantity in text without the signs, and without the zero, that a lower bound forbids."""
    if bound < 0:
        return pattern
    sign = _POSITIVE if exclusive or bound > 0 else _NOT_NEGATIVE
    return pattern.replace(f"^ *{_ANY_SIGN}", f"^ *{sign}", 1)


def _refused(reason: str) -> PydanticCustomError:
    # A brace in the text would be a placeholder of pydantic's template.
    return PydanticCustomError("quantity", "{reason}", {"reason": reason})


VARIATION: Final = "$variation"  # the placeholder in the name of a golden file for the values of a variation


@dataclass(frozen=True, slots=True)
class NamesFile:
    """An annotation that makes a text, or each text in a list or map, the name of a file relative to the scenario."""

    if_there: bool = False  # True if it is a file name only when such a file exists, such as an argument of a program


def is_plain_name(name: str) -> bool:
    """Return True if the name has no effect in tables, XML, workflow commands and file names."""
    return name.isprintable() and name == name.strip() and not any(part in name for part in _NOT_IN_NAMES)


def is_title(name: str) -> bool:
    """Return True if a scenario can have the name: one line, and no command of a workflow."""
    return name.isprintable() and name == name.strip() and not any(part in name for part in _NOT_IN_TITLES)


def _title(name: str) -> str:
    return name if is_title(name) else _refuse_name(name, _NOT_IN_TITLES)


def _plain_name(name: str) -> str:
    return name if is_plain_name(name) else _refuse_name(name, _NOT_IN_NAMES)


def _refuse_name(name: str, parts: Sequence[str]) -> NoReturn:
    forbidden = next((part for part in parts if part in name), None)
    space = "a space at its beginning or end"
    what = f"contains '{forbidden}'" if forbidden else f"has a control character, a line break, or {space}"
    raise ValueError(f"a name is one line of plain text; {name!r} {what}")


_NOT_IN_TITLES: Final = ("::", "##[", "]]>", "${{")
_NOT_IN_NAMES: Final = ("|", "<", ">", "`", *_NOT_IN_TITLES)

Name = Annotated[str, Field(min_length=1, max_length=120), AfterValidator(_plain_name)]
"""The name of a body, a link or a sensor."""

Title = Annotated[str, Field(min_length=1, max_length=120), AfterValidator(_title)]
"""The name of a scenario or an expectation. Only reports use it, and they escape it."""

Tag = Annotated[str, Field(max_length=60, pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")]
Seconds = Annotated[float, Quantity((units.TIME,))]
PositiveSeconds = Annotated[float, Gt(0), Quantity((units.TIME,))]
NonNegativeSeconds = Annotated[float, Ge(0), Quantity((units.TIME,))]
Metres = Annotated[float, Quantity((units.LENGTH,))]
PositiveMetres = Annotated[float, Gt(0), Quantity((units.LENGTH,))]
NonNegativeMetres = Annotated[float, Ge(0), Quantity((units.LENGTH,))]
Radians = Annotated[float, Quantity((units.ANGLE,))]
PositiveRadians = Annotated[float, Gt(0), Quantity((units.ANGLE,))]
PositiveHertz = Annotated[float, Gt(0), Quantity((units.FREQUENCY,))]
PositiveKilograms = Annotated[float, Gt(0), Quantity((units.MASS,))]
PositiveBytes = Annotated[float, Gt(0), Quantity((units.DATA,))]
MetresPerSecond = Annotated[float, Quantity((units.SPEED,))]
NonNegativeMetresPerSecond = Annotated[float, Ge(0), Quantity((units.SPEED,))]
PositiveMetresPerSecond = Annotated[float, Gt(0), Quantity((units.SPEED,))]
RadiansPerSecond = Annotated[float, Quantity((units.ANGULAR_SPEED,), math.inf)]
NonNegativeRadiansPerSecond = Annotated[float, Ge(0), Quantity((units.ANGULAR_SPEED,))]
PositiveRadiansPerSecond = Annotated[float, Gt(0), Quantity((units.ANGULAR_SPEED,))]
MetresPerSecondSquared = Annotated[float, Quantity((units.ACCELERATION,))]
PositiveMetresPerSecondSquared = Annotated[float, Gt(0), Quantity((units.ACCELERATION,))]
NonNegativeMetresPerSecondSquared = Annotated[float, Ge(0), Quantity((units.ACCELERATION,))]
PositiveNewtonMetres = Annotated[float, Gt(0), Quantity((units.TORQUE,))]
PositiveNewtons = Annotated[float, Gt(0), Quantity((units.FORCE,))]
PositiveNewtonSeconds = Annotated[float, Gt(0), Quantity((units.IMPULSE,))]
NonNegativeJoules = Annotated[float, Ge(0), Quantity((units.ENERGY,))]
KilogramSquareMetres = Annotated[float, Quantity((units.INERTIA,))]
NonNegativeKilogramSquareMetres = Annotated[float, Ge(0), Quantity((units.INERTIA,))]
Ratio = Annotated[float, Quantity((units.RATIO,))]
NonNegativeRatio = Annotated[float, Ge(0), Quantity((units.RATIO,))]
PositiveRatio = Annotated[float, Gt(0), Quantity((units.RATIO,))]
PositiveShare = Annotated[float, Gt(0), Quantity((units.SHARE,))]
NonNegativeShare = Annotated[float, Ge(0), Quantity((units.SHARE,))]
JointPosition = Annotated[float | str, Written((units.ANGLE, units.LENGTH))]
JointVelocity = Annotated[float | str, Written((units.ANGULAR_SPEED, units.SPEED))]
JointEffort = Annotated[float | str, Written((units.TORQUE, units.FORCE))]
JointQuantity = Annotated[
    float | str, Written((units.ANGLE, units.LENGTH, units.ANGULAR_SPEED, units.SPEED, units.TORQUE, units.FORCE))
]
SensorQuantity = Annotated[
    float | str, Written((units.LENGTH, units.FORCE, units.ACCELERATION, units.ANGULAR_SPEED, units.SPEED))
]


MAX_COORDINATE_M: Final = 100_000.0
"""In m from the origin of the world: farther away, the numbers of the engines have no millimetres."""

Coordinate = Annotated[Metres, Field(ge=-MAX_COORDINATE_M, le=MAX_COORDINATE_M)]


class Placement(FrozenModel):
    """The start pose of a robot or body, in the world frame."""

    x: Coordinate = 0.0
    y: Coordinate = 0.0
    z: Annotated[Coordinate | None, Field(description="default: it stands on the ground")] = None
    roll: Radians = 0.0
    pitch: Radians = 0.0
    yaw: Radians = 0.0

    @classmethod
    def of(cls, pose: geometry.Pose) -> Self:
        """Return the placement at a pose."""
        x, y, z = pose.position_xyz
        roll, pitch, yaw = geometry.rpy_from_quaternion(pose.orientation_xyzw)
        return cls(x=x, y=y, z=z, roll=roll, pitch=pitch, yaw=yaw)

    @property
    def orientation_xyzw(self) -> geometry.Quaternion:
        """The orientation as a quaternion, from roll, pitch and yaw."""
        return geometry.quaternion_from_rpy(self.roll, self.pitch, self.yaw)


class RelativePose(FrozenModel):
    """A pose in another frame."""

    x: Metres = 0.0
    y: Metres = 0.0
    z: Metres = 0.0
    roll: Radians = 0.0
    pitch: Radians = 0.0
    yaw: Radians = 0.0

    @property
    def pose(self) -> geometry.Pose:
        """The same as a `Pose`: position and quaternion."""
        rotation = geometry.quaternion_from_rpy(self.roll, self.pitch, self.yaw)
        return geometry.Pose((self.x, self.y, self.z), rotation)


_DEGREE: Final = math.pi / 180
_BYTES: Final = ((2**30, "GiB"), (2**20, "MiB"), (1, "B"))
_LONG: Final = 10_000  # numbers from here on have thousands separators


def bound_text(value: float, unit: str) -> str:
    """Return a bound as messages show it: all digits, angles in degrees, no unit for 0."""
    number, unit = _written(value, unit)
    return f"{number} {unit}".rstrip() if value else "0"


def bounds_text(annotation: Any, metadata: Iterable[Any]) -> str:
    """Return both bounds of a field, such as "at most 170 deg" or "1 to 1920"; a lower bound of 0 is left out."""
    unit = unit_of(annotation, metadata)
    constraints = [*metadata, *_of_optional(annotation)]
    lower = next((item for item in constraints if isinstance(item, Gt | Ge) and _value(item)), None)
    upper = next((item for item in constraints if isinstance(item, Lt | Le)), None)
    if upper is None:
        word = "more than" if isinstance(lower, Gt) else "at least"
        return f"{word} {bound_text(_value(lower), unit)}" if lower else ""
    if lower is None:
        return f"{'less than' if isinstance(upper, Lt) else 'at most'} {bound_text(_value(upper), unit)}"
    return f"{_written(_value(lower), unit)[0]} to {bound_text(_value(upper), unit)}"


def unit_of(annotation: Any, metadata: Iterable[Any] = ()) -> str:
    """Return the SI unit of the first quantity in a field; "" if there is none, or if it has several dimensions."""
    quantity = next((item for item in (*metadata, *_all_in(annotation)) if isinstance(item, Quantity)), None)
    return quantity.dimensions[0].si if quantity and len(quantity.dimensions) == 1 else ""


def _written(value: float, unit: str) -> tuple[str, str]:
    """Return a number and its unit as messages show them."""
    if unit in ("rad", "rad/s"):
        value, unit = value / _DEGREE, unit.replace("rad", "deg")
    if unit == "B":
        value, unit = next((value / size, name) for size, name in _BYTES if value % size == 0)
    if float(value).is_integer():
        value = int(value)
        return f"{value:,}" if abs(value) >= _LONG else str(value), unit
    return f"{value:,.6g}", unit


def _value(item: Any) -> float:
    bound: float = next(getattr(item, name) for name in ("gt", "ge", "lt", "le") if hasattr(item, name))
    return bound


def _said_of(annotation: Any) -> Iterator[Any]:
    for item in getattr(annotation, "__metadata__", ()):
        yield from item.metadata if isinstance(item, FieldInfo) else (item,)


def _of_optional(annotation: Any) -> Iterator[Any]:
    parts = [part for part in get_args(annotation) if part is not type(None)]
    if len(parts) == 1 and type(None) in get_args(annotation):
        yield from _said_of(parts[0])


def _all_in(annotation: Any) -> Iterator[Any]:
    """Yield all annotations in a type, such as of list items; the fields of nested models are left out."""
    yield from _said_of(annotation)
    for part in get_args(annotation):
        if not (isinstance(part, type) and issubclass(part, BaseModel)):
            yield from _all_in(part)


def on_lines(value: Any) -> Any:
    """Return a value whose texts are one printable line each: a name in a model may have line breaks."""
    if isinstance(value, str):
        return escaped_line(value)
    if isinstance(value, FrozenModel):
        return value.model_copy(update={name: on_lines(part) for name, part in value})
    if is_dataclass(value) and not isinstance(value, type):
        return replace(value, **{field.name: on_lines(getattr(value, field.name)) for field in fields(value)})
    return tuple(map(on_lines, value)) if isinstance(value, tuple) else value


_PLAIN: Final = re.compile(r"[A-Za-z_][\w./*-]*")
_BAD_KEY: Final = "[key]"
_BOUNDS = ("gt", "ge", "lt", "le")
_EXPECTED = {
    "model_type": "a map of keys",
    "model_attributes_type": "a map of keys",
    "dict_type": "a map of keys",
    "tuple_type": "a list",
    "string_type": "text",
    "bool_type": "true or false",
    "int_type": "a whole number",
    "float_type": "a number",
    "is_instance_of": "a map of keys",
}

_SENTENCES = {
    "literal_error": "expected {expected}, found {found}",
    "greater_than": "must be greater than {gt}, found {found}",
    "greater_than_equal": "must be at least {ge}, found {found}",
    "less_than": "must be less than {lt}, found {found}",
    "less_than_equal": "must be at most {le}, found {found}",
    "string_pattern_mismatch": "expected text that matches {pattern}, found {found}",
    "too_long": "expected a list of at most {max_length}, found {found}",
    "too_short": "expected a list of at least {min_length}, found {found}",
    "string_too_short": "must have at least {min_length} characters, found {found}",
    "string_too_long": "must have at most {max_length} characters",
}


def spec_errors(
    model: type[BaseModel], data: object, error: ValidationError
) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """Yield each finding of pydantic about `data` as a sentence, with the path of its key."""
    hinted = FirstFew()
    for path, details in _of_likely_members(data, error.errors(include_url=False)):
        yield path, _sentence(model, details, _as_written(data, details), hinted)


def _of_likely_members(
    data: object, listed: Sequence[ErrorDetails]
) -> Iterator[tuple[tuple[str | int, ...], ErrorDetails]]:
    """Yield the findings with paths of the file: pydantic lists all members of a union, with a step for each."""
    placed = [(*_place(data, details["loc"]), details) for details in listed]
    # The member of each union that goes deepest into the value has its shape.
    likely: dict[tuple[str | int, ...], tuple[int, bool]] = {}
    for path, union, details in placed:
        if union is not None:
            likely[union] = max(likely.get(union, (0, False)), (len(path), details["type"] not in _EXPECTED))
    for path, union, details in placed:
        if union is None or (len(path), details["type"] not in _EXPECTED) == likely[union]:
            yield path, details


def _place(data: Any, steps: tuple[str | int, ...]) -> tuple[tuple[str | int, ...], tuple[str | int, ...] | None]:
    """Return the path of a finding in the file, and the path of the union around it; None if it is in no union."""
    path: list[str | int] = []
    union: tuple[str | int, ...] | None = None
    for step in steps:
        is_in_file = isinstance(data, dict) and step in data
        is_member = isinstance(step, str) and not is_in_file and ("[" in step or isinstance(data, str | float | int))
        if is_member and step != _BAD_KEY:
            union = union or tuple(path)
        elif step != _BAD_KEY:
            path.append(step)
            data = data[step] if is_in_file or (isinstance(data, list) and step in range(len(data))) else None
    return tuple(path), union


def _as_written(data: Any, details: ErrorDetails) -> object:
    """Return the value as it is written in the file; pydantic knows only its SI value."""
    try:
        for step in details["loc"]:
            data = data[step]
    except (LookupError, TypeError):
        return details["input"]
    return data


def _sentence(model: type[BaseModel], details: ErrorDetails, value: object, hinted: FirstFew) -> str:
    kind = details["type"]
    key = details["loc"][-1] if details["loc"] else ""
    if kind == "missing":
        # pydantic reports missing entries of a list with a fixed length like missing keys.
        return f"entry {key + 1} of the list is missing" if isinstance(key, int) else f"the key '{key}' is missing"
    if kind == "extra_forbidden":
        return f"unknown key{_advice(str(key), _annotation_at(model, details['loc'][:-1]), hinted)}"
    if details.get("ctx", {}).get("min_length") == 1:
        return "must not be empty"
    if kind in _SENTENCES:
        return _SENTENCES[kind].format(found=shown(value), **_context(model, details))
    if kind in _EXPECTED:
        # The key of an entry of a list has the type of the list.
        in_list = isinstance(key, int)
        hint = _hint(kind, value, _annotation_at(model, details["loc"]), in_list=in_list)
        return f"expected {_EXPECTED[kind]}, found {shown(value)}{hint}"
    return details["msg"].removeprefix("Value error, ")


def _context(model: type[BaseModel], details: ErrorDetails) -> dict[str, Any]:
    last = list(_fields_along(model, details["loc"]))[-1:]
    unit = unit_of(last[0].annotation, last[0].metadata) if last else ""
    named = details.get("ctx", {})
    return {key: bound_text(value, unit) if key in _BOUNDS else value for key, value in named.items()}


def _hint(kind: str, value: object, annotation: Any, *, in_list: bool) -> str:
    if kind == "string_type" and isinstance(value, (bool, int, float)):
        return "; put it in quotes"
    if kind != "tuple_type":
        return ""
    if isinstance(value, str) and _PLAIN.fullmatch(value) and not in_list and _takes_any_number(annotation):
        return f"; write [{value}]"
    return "; begin each entry of a list with '- '" if isinstance(value, dict) else ""


def _takes_any_number(annotation: Any) -> bool:
    return Ellipsis in get_args(annotation) or any(map(_takes_any_number, get_args(annotation)))


def _annotation_at(model: type[BaseModel], path: tuple[str | int, ...]) -> Any:
    last = list(_fields_along(model, path))[-1:]
    return last[0].annotation if last else model


def _advice(key: str, owner: Any, hinted: FirstFew) -> str:
    if foreign := getattr(owner, "foreign_keys", {}).get(key):
        return f"; {foreign}"
    names = [field.alias or name for name, field in _fields(owner).items()]
    return did_you_mean(key, names) if hinted.one_more() else ""


def _fields_along(model: type[BaseModel], path: tuple[str | int, ...]) -> Iterator[FieldInfo]:
    """Yield the fields of models along a path."""
    at: Any = model
    for step in path:
        fields = {field.alias or name: field for name, field in _fields(at).items()}
        if isinstance(step, str) and step in fields:
            at = fields[step].annotation
            yield fields[step]


def _fields(annotation: Any) -> dict[str, FieldInfo]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return dict(annotation.model_fields)
    return next((model_fields for part in get_args(annotation) if (model_fields := _fields(part))), {})
