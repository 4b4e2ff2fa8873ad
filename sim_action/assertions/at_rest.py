"""What rest is, for assertions that ask for it."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from sim_action.assertions import Assertion
from sim_action.core.field_types import PositiveMetresPerSecond, PositiveRadiansPerSecond, PositiveSeconds


class AtRest(Assertion):
    """How slow, and for how long."""

    speed: Annotated[PositiveMetresPerSecond, Field(description="of the base, and of joints that slide")] = 0.01
    turn_rate: Annotated[PositiveRadiansPerSecond, Field(description="of the base, and of joints that turn")] = (
        math.radians(1)
    )
    span: Annotated[PositiveSeconds, Field(alias="for", description="how long it stays at rest")] = 1.0
