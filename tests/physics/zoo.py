"""The zoo: robots and bodies whose motion is known, on both engines. `ZOO` has all cases."""

from __future__ import annotations

from typing import Final

from tests.physics import arms, bodies, built_in, caster, driving, fresh, legs, skid, slopes
from tests.physics.case import Case

ZOO: Final[tuple[Case, ...]] = (
    *caster.CASES,
    *skid.CASES,
    *driving.CASES,
    *arms.CASES,
    *legs.CASES,
    *bodies.CASES,
    *slopes.CASES,
    *built_in.CASES,
    *fresh.CASES,
)
GROUPS: Final = tuple(dict.fromkeys(case.group for case in ZOO))
