"""Field types of a scenario: floats in SI that a file may write with a unit, and the frozen base of all models.

`Metres` and its siblings are plain `float` to the code that uses them; pydantic reads them with `units.parse` and
describes them in the JSON Schema.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated, Any, Final

from annotated_types import Ge, Gt
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from sim_action.core import units
from sim_action.core.units import Dimension


class FrozenModel(BaseModel):
    """What every part of a scenario is: immutable, strict about types, and closed to unknown keys."""

    # A validator is built when it is first needed: most models are only parts of another. So a part that is left out is
    # made by model_construct(), which needs none.
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, defer_build=True)


_JSON_SCHEMA_WORDS: Final = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum", "le": "maximum"}


@dataclass(frozen=True, slots=True)
class Quantity:
    """Annotates a float as a quantity of one dimension (or of any of several, for joints that turn or slide)."""

    dimensions: tuple[Dimension, ...]

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self._read, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return self._with_unit(handler(schema))

    def _with_unit(self, number_schema: dict[str, Any]) -> dict[str, Any]:
        # pydantic leaves bounds that were added outside of this annotation in its own words.
        number = {_JSON_SCHEMA_WORDS.get(key, key): value for key, value in number_schema.items()}
        symbols = [symbol for dimension in self.dimensions for symbol in dimension.factors if symbol]
        if not symbols:
            return number
        pattern = f"^\\s*[-+]?[0-9.]+([eE][-+]?[0-9]+)?\\s*({'|'.join(re.escape(s) for s in symbols)})?\\s*$"
        return {"anyOf": [number, {"type": "string", "pattern": pattern, "examples": [f"1 {symbols[0]}"]}]}

    def _read(self, value: object) -> object:
        try:
            return units.parse(value, *self.dimensions)
        except units.UnitError as error:
            # A brace would be read as a placeholder of pydantic's template.
            raise PydanticCustomError("quantity", "{reason}", {"reason": str(error)}) from None


@dataclass(frozen=True)
class Written(Quantity):
    """Annotates a quantity that stays as it was written: only the model tells which of the dimensions is right."""

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return self._with_unit({"type": "number"})

    def _read(self, value: object) -> object:
        super()._read(value)
        return value


@dataclass(frozen=True, slots=True)
class NamesFile:
    """Annotates a text, or the entries of a list or map of it, as the name of a file, seen from the scenario.

    Attributes:
        if_there: whether it is one only if there is such a file, such as an argument of a program.
    """

    if_there: bool = False


def is_plain_name(name: str) -> bool:
    """Whether nothing in it would act in tables, XML, workflow commands or file names."""
    return name.isprintable() and name == name.strip() and not any(part in name for part in _NOT_IN_NAMES)


def _plain_name(name: str) -> str:
    """What would act where names stand is refused at the door."""
    if not is_plain_name(name):
        found = next((part for part in _NOT_IN_NAMES if part in name), None)
        what = f"contains '{found}'" if found else "has a control character, a line break or a space at its end"
        raise ValueError(f"a name is one line of plain text; {name!r} {what}")
    return name


_NOT_IN_NAMES: Final = ("|", "<", ">", "`", "::", "##[", "]]>", "${{")

Name = Annotated[str, Field(min_length=1, max_length=120), AfterValidator(_plain_name)]
Tag = Annotated[str, Field(max_length=60, pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")]
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
RadiansPerSecond = Annotated[float, Quantity((units.ANGULAR_SPEED,))]
NonNegativeRadiansPerSecond = Annotated[float, Ge(0), Quantity((units.ANGULAR_SPEED,))]
PositiveRadiansPerSecond = Annotated[float, Gt(0), Quantity((units.ANGULAR_SPEED,))]
MetresPerSecondSquared = Annotated[float, Quantity((units.ACCELERATION,))]
PositiveMetresPerSecondSquared = Annotated[float, Gt(0), Quantity((units.ACCELERATION,))]
NonNegativeMetresPerSecondSquared = Annotated[float, Ge(0), Quantity((units.ACCELERATION,))]
PositiveNewtonMetres = Annotated[float, Gt(0), Quantity((units.TORQUE,))]
PositiveNewtons = Annotated[float, Gt(0), Quantity((units.FORCE,))]
NonNegativeJoules = Annotated[float, Ge(0), Quantity((units.ENERGY,))]
NonNegativeKilogramSquareMetres = Annotated[float, Ge(0), Quantity((units.INERTIA,))]
Ratio = Annotated[float, Quantity((units.RATIO,))]
NonNegativeRatio = Annotated[float, Ge(0), Quantity((units.RATIO,))]
PositiveRatio = Annotated[float, Gt(0), Quantity((units.RATIO,))]
PositiveShare = Annotated[float, Gt(0), Quantity((units.SHARE,))]
JointPosition = Annotated[float | str, Written((units.ANGLE, units.LENGTH))]
JointVelocity = Annotated[float | str, Written((units.ANGULAR_SPEED, units.SPEED))]
JointEffort = Annotated[float | str, Written((units.TORQUE, units.FORCE))]
JointQuantity = Annotated[
    float | str,
    Written((units.ANGLE, units.LENGTH, units.ANGULAR_SPEED, units.SPEED, units.TORQUE, units.FORCE)),
]
SensorQuantity = Annotated[
    float | str, Written((units.LENGTH, units.FORCE, units.ACCELERATION, units.ANGULAR_SPEED, units.SPEED))
]
