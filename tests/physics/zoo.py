"""The zoo: robots and bodies whose motion is known, on both engines. `ZOO` has all cases."""

from __future__ import annotations

from typing import Final

from tests.physics import bodies, caster, skid
from tests.physics.case import Case

ZOO: Final[tuple[Case, ...]] = (*caster.CASES, *skid.CASES, *bodies.CASES)
GROUPS: Final = tuple(dict.fromkeys(case.group for case in ZOO))
