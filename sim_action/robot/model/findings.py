"""The table of all rules of the audit, and what a finding of each level leads to.

Each finding carries the name of its rule. `robot.allow` lists the names of rules whose errors are accepted.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import PurePath
from typing import Final, Literal

from sim_action.core.errors import Location, Problem, RefusedModel
from sim_action.core.records import dataclass, replace
from sim_action.core.wording import escaped_line

_MAX_REPORTED: Final = 100  # each finding is a line in every report
_MAX_LINES: Final = 8


Level = Literal["fatal", "error", "warning", "harmless"]
"""fatal: cannot be simulated; error: refused unless allowed, as it is probably not what was meant; warning: a note;
harmless: the motion is the same, so that only `inspect --losses` lists it."""


@dataclass(frozen=True, slots=True)
class Finding:
    """A violation of a rule of the audit, and its place."""

    rule: str
    level: Level
    message: str
    location: Location

    def __str__(self) -> str:
        return f"{self.location}: {self.message} [{self.rule}]"


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule of the audit: the level of its findings, and their summary for the documents."""

    level: Level
    summary: str


_SUMMARIES: Final[Mapping[Level, Mapping[str, str]]] = {
    "fatal": {
        "bad-xml": "XML that is not well-formed, too deep, too large, or has a DOCTYPE",
        "bad-xacro": "a xacro file that cannot be evaluated",
        "unknown-argument": "an argument in `robot.args` that the xacro file does not declare",
        "missing-include": "an included file that does not exist",
        "missing-package": "a package that cannot be found",
        "outside-workspace": "a mesh or an included file that lies outside the workspace",
        "bad-reference": "a reference that names no file",
        "not-a-robot": "a file without a robot model, or with several models",
        "missing-part": "an element without a required child element or attribute",
        "bad-number": "a value that is not the required count of finite numbers, or out of range",
        "bad-name": "a link or joint name that is too long for the engine",
        "duplicate-name": "two links, or two joints, with the same name",
        "unknown-frame": "a name in SDF that refers to no link, joint, frame or model",
        "frame-loop": "frames in SDF that are relative to each other, or attached to each other, in a loop",
        "include-loop": "an SDF model that includes itself, or includes too many models",
        "unknown-link": "a joint that names a link that does not exist",
        "two-parents": "a link that is the child of two joints",
        "one-root": "a model without a root link, or with several",
        "loop": "joints that form a loop",
        "joint-type": "an unknown joint type",
        "too-many-joints": "more than 1,000 joints",
        "unknown-shape": "a shape that is not supported",
        "bad-shape": "a size that is not greater than 0",
        "zero-axis": "a moving joint with an axis of length 0",
        "negative-mass": "a mass below 0",
        "missing-mesh": "a collision mesh that does not exist",
        "unknown-mesh-format": "a collision mesh in another format than STL, OBJ or DAE",
        "broken-mesh": "a collision mesh that cannot be read",
        "empty-mesh": "a collision mesh in which no triangle has an area",
        "mesh-index": "a collision mesh with a face that refers to a missing point",
        "too-large-mesh": "a collision mesh with too many triangles or bytes",
    },
    "error": {
        "unsupported-joint": "a screw joint in SDF, which no engine has; if allowed, it is fixed",
        "bad-mimic": "a <mimic> that cannot work; if allowed, the joint moves independently",
        "unexpanded-expression": "an unexpanded xacro expression, ${...} or $(...); if allowed, the value counts as "
        "left out",
        "missing-limits": "a prismatic joint without limits, or a <limit> without positions; if allowed, it moves "
        "without limits",
        "reversed-limits": "a lower limit above the upper limit; if allowed, the joint moves without limits",
        "zero-mass": "a mass of 0 on a link that moves by itself; if allowed, it gets a negligible mass",
        "impossible-inertia": "a principal moment of inertia below 0, by more than rounding; if allowed, all three "
        "moments are increased until they are possible",
        "absurd-size": "a part that is larger than a robot can be: probably in millimetres instead of metres",
        "restitution": "a contact with a restitution above 0.1: nothing bounces in the simulation; if allowed, it is "
        "ignored",
        "unsupported-part": "a part of SDF that is not supported; if allowed, it is ignored",
    },
    "warning": {
        "xacro-warning": "a warning that xacro itself printed",
        "missing-visual": "a visual mesh that does not exist: it is not drawn",
        "massless-model": "a model in which no link has a mass: every link gets a negligible mass, and the base must "
        "be fixed",
        "massless-base": "a mass of 0 on the base link: the base must be fixed",
        "massless-frame": "a mass of 0 on a link that is fixed to a link with a mass: it adds nothing",
        "rounded-inertia": "moments of inertia that are impossible only by rounding: they are increased until they are "
        "possible",
        "uneven-inertia": "a moment of inertia that is greater than the sum of the other two, which no body can have: "
        "they are increased until they are possible",
        "zero-inertia": "moments of inertia that are all 0: the mass counts as a ball of 5 cm radius",
        "empty-shape": "a collision shape whose sizes are all 0: it is ignored",
        "unlimited-joint": "a revolute joint without <limit>: it turns without limits",
        "continuous-limits": "position limits of a continuous joint: URDF has none, so it turns without limits",
        "still-mimic": "a <mimic> that never moves its joint: the joint is fixed",
        "many-joints": "more joints than PyBullet supports, 127 in total and 121 that move: only MuJoCo simulates them",
        "late-declaration": "white space or a comment before <?xml ...?>",
        "default-expression": "an expression $(optenv NAME DEFAULT) in a URDF: DEFAULT is used",
        "locked-joint": "a joint that cannot move because its limits are equal, often 0 on a wheel",
        "concave-mesh": "a collision mesh that is not convex: its convex hull collides",
        "tiny-mesh": "a collision mesh smaller than 1 mm: probably scaled to metres twice",
        "flat-mesh": "a collision mesh without a volume",
        "several-packages": "several packages with the same name: the nearest one is used",
        "package-folder": "a package without a package.xml: a folder of its name, or with its files, is used",
        "file-spelling": "a file or reference that is spelled otherwise than on the disk",
        "missing-inertia": "a URDF link without <inertial>: it gets a negligible mass",
        "unknown-reference": "a <gazebo> tag for a link or joint that does not exist",
        "two-frictions": "friction that depends on the direction: one coefficient is used for all directions",
        "zero-limit": "an effort or velocity of 0 or less in <limit>: it counts as no limit",
        "follower-limits": "a joint whose <mimic> takes it beyond its own limits",
        "odd-angle": "a rotation of more than a full turn: probably in degrees instead of radians",
        "odd-limits": "limits that are too far apart for a robot: probably in degrees or millimetres",
        "unknown-tag": "an unknown element whose name is close to one of URDF's: it is ignored",
        "second-inertial": "a link with more than one <inertial>: the first one is used",
        "odd-inertia": "an inertia that does not fit the mass and size of its link: probably in another unit",
        "odd-mass": "a model that is denser than any metal: its masses are probably in another unit",
        "default-inertia": "an SDF link that lacks <inertial>, its mass or a moment: it is 1, the default of SDF",
        "turned-base": "a root link that the SDF file rotates: set robot.pose instead",
        "start-position": "joints that <ros2_control> starts at its `initial_value`",
        "control-mimic": "a joint that mimics another by a parameter of <ros2_control>",
        "lenient-xml": "XML that strict readers refuse: `--` in a comment, or a bare `&`",
        "moving-surface": "a geom of MJCF whose surface moves, such as a belt",
        "open-mesh": "a mesh of MJCF that gives a body its mass, with missing or doubled faces",
        "passed-over": "a part of the model that is not simulated: it is ignored",
        "unknown-part": "an element or attribute that the format does not have: it is not read",
        "shared-friction": "collisions of an SDF link with different frictions: the smallest counts for all",
        "unused-sensor": "a sensor of the model: a scenario has its own `sensors`",
        "no-collision-shape": "a model without a collision shape: nothing can touch it",
    },
    "harmless": {"harmless-part": "a part of the model that is not read, and without which the motion is the same"},
}
RULES: Final[Mapping[str, Rule]] = {
    name: Rule(level, summary) for level, rows in _SUMMARIES.items() for name, summary in rows.items()
}


ALLOWABLE: Final = tuple(name for name, rule in RULES.items() if rule.level == "error")
"""The rules that `robot.allow` may name: those whose level is "error"."""


def finding(rule: str, message: str, location: Location) -> Finding:
    """Return a finding of a rule, with the rule's level."""
    return Finding(rule, RULES[rule].level, escaped_line(message), location)


def refuse_errors(findings: Iterable[Finding], allowed: Iterable[str] = ()) -> None:
    """Raise RefusedModel if there is a fatal finding, or an error whose rule is not in `allowed`."""
    lenient = set(allowed)
    refused = (
        Problem(finding.location, f"{finding.message} [{finding.rule}]")
        for finding in findings
        if finding.level == "fatal" or (finding.level == "error" and finding.rule not in lenient)
    )
    # A file that is included many times has the same problem each time.
    problems = list(dict.fromkeys(refused))
    if len(problems) > _MAX_REPORTED:
        more = _more(len(problems) - _MAX_REPORTED)
        problems[_MAX_REPORTED:] = [Problem(problems[_MAX_REPORTED].location, more)]
    if problems:
        raise RefusedModel(problems)


def limited_notes(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the first findings of each rule, and one finding that counts the rest of that rule."""
    kept = list[Finding]()
    counts = Counter[str]()
    left_out: dict[str, Finding] = {}
    for note in findings:
        counts[note.rule] += 1
        if counts[note.rule] <= _MAX_REPORTED:
            kept.append(note)
        else:
            left_out.setdefault(note.rule, note)
    rest = (replace(note, message=_more(counts[rule] - _MAX_REPORTED)) for rule, note in left_out.items())
    return (*kept, *rest)


_ANNOUNCED: Final = frozenset(
    {
        "concave-mesh",
        "default-inertia",
        "file-spelling",
        "impossible-inertia",
        "massless-base",
        "massless-model",
        "missing-visual",
        "package-folder",
        "passed-over",
        "restitution",
        "second-inertial",
        "several-packages",
        "shared-friction",
        "turned-base",
        "two-frictions",
        "uneven-inertia",
        "unknown-reference",
        "unknown-tag",
        "unused-sensor",
        "zero-inertia",
    }
)
"""Rules whose notes every report shows: a part is not simulated as the file states it, or a file had to be searched."""


def announced(findings: Iterable[Finding]) -> tuple[str, ...]:
    """Return the notes that every report shows."""
    return grouped_notes(note for note in findings if _is_announced(note))


_COUNTED: Final = frozenset({"passed-over", "unused-sensor", "unknown-part"})
"""Rules of which the readers report each kind of parts once, with the count and the lines."""


def _is_announced(note: Finding) -> bool:
    return note.level == "warning" and note.rule in _ANNOUNCED


def unannounced(findings: Iterable[Finding]) -> tuple[str, ...]:
    """Return the other notes."""
    return grouped_notes(note for note in findings if not _is_announced(note))


def without_harmless(findings: Iterable[Finding]) -> tuple[tuple[Finding, ...], tuple[Finding, ...]]:
    """Return the findings without those on harmless parts, and those."""
    kept = tuple(findings)
    return tuple(note for note in kept if note.level != "harmless"), tuple(n for n in kept if n.level == "harmless")


class Places:
    """The places of one kind of parts, which becomes one finding."""

    def __init__(self, first: Location) -> None:
        self.first, self._lines, self._count = first, dict[str, None](), 0

    def add(self, place: Location, count: int = 1) -> None:
        """Add a place with a number of parts."""
        self._count += count
        if len(self._lines) <= _MAX_LINES:
            line = str(place.line) if place.file == self.first.file else f"{PurePath(place.file).name}:{place.line}"
            self._lines[line] = None

    def __str__(self) -> str:
        """The count and the lines; empty for one part."""
        if self._count <= 1:
            return ""
        lines = ", ".join([*self._lines][:_MAX_LINES]) + (", ..." if len(self._lines) > _MAX_LINES else "")
        return f" ({self._count} of them; line{'s' * (len(self._lines) > 1)} {lines})"


def grouped_notes(findings: Iterable[Finding]) -> tuple[str, ...]:
    """Return the findings as text, one for each rule and file, with the lines of the others; but all of `_COUNTED`."""
    groups: dict[tuple[str, str, str], list[Finding]] = {}
    for note in findings:
        kind = note.message if note.rule in _COUNTED else ""
        groups.setdefault((note.rule, note.location.file, kind), []).append(note)
    return tuple(map(_note, groups.values()))


def _note(findings: Sequence[Finding]) -> str:
    first, *others = findings
    if not others:
        return str(first)
    lines = list(dict.fromkeys(other.location.line for other in others))
    shown = ", ".join(map(str, lines[:_MAX_LINES])) + (", ..." if len(lines) > _MAX_LINES else "")
    more = f"and {len(others):,} more like this; line{'s' * (len(lines) > 1)} {shown}"
    return f"{first.location}: {first.message} ({more}) [{first.rule}]"


def _more(count: int) -> str:
    return f"{count:,} more problems like these; check the program that exported this file"
