"""The reference of verdicts: for each assertion, when it passes, when it fails and when it is not exercised."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from tools.docs.generators.markdown import table

_NEVER_OPENED: Final = "The run ended before `after`."
_NO_READING: Final = "The sensor had no reading between `after` and `before`, or the run ended before `after`."


@dataclass(frozen=True, slots=True)
class Verdicts:
    """The conditions for each verdict on an assertion, in one or two sentences each."""

    passed: str
    failed: str
    not_exercised: str = _NEVER_OPENED

    def shown(self) -> str:
        """Return the table for the reference."""
        rows = (("passed", self.passed), ("failed", self.failed), ("not exercised", self.not_exercised))
        return table(("verdict", "when"), rows)


VERDICTS: Final = {
    "travel": Verdicts(
        "The distance reached `at_least` at some step, and exceeded `at_most` at no step.",
        "The distance never reached `at_least`, or it exceeded `at_most` at a step.",
    ),
    "path_length": Verdicts(
        "The length reached `at_least`, and never exceeded `at_most`.",
        "The length never reached `at_least`, or it exceeded `at_most`.",
    ),
    "reach": Verdicts(
        "The robot was elsewhere, and then came to the place, with the heading `yaw` if it is given.",
        "The robot never came so near, or it was there at t = 0 and never came back.",
    ),
    "settled": Verdicts(
        "The robot moved, and then was at rest for the time `for`.",
        "The robot was never at rest for so long, or it was at rest from t = 0 on and never moved.",
    ),
    "final_pose": Verdicts(
        "At the last step, place and heading were within the tolerances.",
        "At the last step, the place or the heading was outside its tolerance.",
    ),
    "follow_path": Verdicts(
        "The distance exceeded `max_error` at no step, its `rms` is within the limit, and the `end` was reached.",
        "The distance exceeded `max_error` at a step, its `rms` is greater, or the `end` was not reached.",
    ),
    "max_speed": Verdicts(
        "Speed and turn rate were within the limits at every step. A robot that stands still passes.",
        "The speed or the turn rate exceeded its limit at a step, or the base jumped.",
    ),
    "stay_within": Verdicts(
        "The robot was between the bounds at every step.",
        "The robot was outside a bound at a step.",
    ),
    "upright": Verdicts(
        "The tilt was at most `max_tilt` at every step.",
        "The tilt exceeded `max_tilt` at a step.",
    ),
    "no_collision": Verdicts(
        "The robot touched no body at any step. With no body that it could touch, the "
        "[audit of claims](claims.md) adds a warning.",
        "The robot touched a body that `allow` does not name.",
    ),
    "self_collision": Verdicts(
        "No two links of the robot touched each other at any step, except neighbours and allowed pairs.",
        "Two links touched each other that `allow` does not name.",
    ),
    "contact": Verdicts(
        "The robot touched the body for the time `for`, with at least `at_least`, and never with more than `at_most`. "
        "With `at_most` alone: no mean force or impulse exceeded it. If the robot never touched the body, the "
        "[audit of claims](claims.md) adds a warning.",
        "The robot never touched the body so long or so strongly, or a mean force or impulse exceeded `at_most`.",
    ),
    "stops_before": Verdicts(
        "The robot moved, and then was at rest for the time `for` with an allowed gap.",
        "The robot touched the body, was never at rest for so long with an allowed gap, or only from t = 0 on.",
    ),
    "clearance": Verdicts(
        "The distance was at least `at_least` at every step; or it was greater than `at_most` and then fell to it.",
        "The distance was less than `at_least` at a step; or it never fell to `at_most`, or only at t = 0.",
        "A link with a collision shape and a body of `to` were never there together, for example because the body "
        "appeared later. Or the run ended before `after`.",
    ),
    "object": Verdicts(
        "`reach`, `settled`, `moved` with `at_least` or `up`: the object was elsewhere or in motion, and then it came "
        "true. `stay_within`, `upright`, `moved` with `at_most`: it held at every step.",
        "The goal never came true, or only from t = 0 on; or a limit was exceeded at a step.",
        "The object never appeared, or the run ended before `after`.",
    ),
    "grasped": Verdicts(
        "The object was not held, and then it was held for the time `for`, with at least `at_least`.",
        "The object was never held so long or so strongly, or only from t = 0 on.",
        "The run ended before `after`.",
    ),
    "feet_on_ground": Verdicts(
        "At every step, at least `at_least` and at most `at_most` of the feet were on the ground. If no foot ever was, "
        "the [audit of claims](claims.md) adds a warning to an `at_most` above 0.",
        "At a step, fewer or more feet were on the ground.",
    ),
    "support_margin": Verdicts(
        "At every step, the centre of mass was at least `at_least` inside the support polygon.",
        "At a step, the centre of mass was nearer to the edge or outside, or no foot was on the ground.",
    ),
    "joint": Verdicts(
        "The reading reached `at_least`, or came `near` after it was elsewhere, and exceeded `at_most` at no step.",
        "The reading never got there, was there only at t = 0, or exceeded `at_most` at a step.",
    ),
    "joint_within": Verdicts(
        "All readings were between their bounds at every step.",
        "A reading was outside a bound at a step.",
    ),
    "effort": Verdicts(
        "No effort exceeded `at_most` at any step, and each RMS at the end is at most `rms_at_most`.",
        "An effort exceeded `at_most` at a step, or an RMS is greater than `rms_at_most`.",
    ),
    "energy": Verdicts(
        "The work never exceeded `at_most`. A robot that stands still passes.",
        "The work exceeded `at_most`.",
    ),
    "sensor": Verdicts(
        "Every reading was within the bounds. With `once`: a reading was outside the bounds, and a later one inside.",
        "A reading was outside the bounds. With `once`: no reading was inside, or only from the first one on.",
        _NO_READING,
    ),
    "odometry_error": Verdicts(
        "No reading differed from the true pose by more than the limits.",
        "A reading differed from the true pose by more than a limit.",
        _NO_READING,
    ),
    "any_of": Verdicts(
        "At least one part passed. A part that passes in every run hides the others.",
        "Every part failed.",
        "No part passed, and a part was never judged.",
    ),
    "all_of": Verdicts(
        "Each part passed, at the same moment or at different ones.",
        "A part failed.",
        "No part failed, and a part was never judged.",
    ),
    "at_once": Verdicts(
        "All parts were true at one moment, after a moment at which one was false.",
        "The parts were never true together, or only from t = 0 on.",
    ),
    "not": Verdicts(
        "The part failed.",
        "The part passed.",
        "The part was never judged.",
    ),
    "stl": Verdicts(
        "The formula is true. An implication whose premise never held is true, and the "
        "[audit of claims](claims.md) adds a warning.",
        "The formula is false.",
        "The run ended before any step of an interval could be judged, before `after`, or before all signals were "
        "known.",
    ),
    "matches": Verdicts(
        "Each row of the file is within the tolerances, and both runs have the same length up to `duration`.",
        "A row differs by more than a tolerance, or one run is longer by more than `duration`.",
    ),
    "assertion": Verdicts(
        "`judge` returned a verdict that has passed. The class decides if anything was checked.",
        "`judge` returned a verdict that has not passed.",
        "`judge` never returned a verdict, or it was never called because the run ended before `after`.",
    ),
}
"""The conditions for the verdicts on each assertion, by its key."""
