"""Results of every kind, and what makes others of them."""

from __future__ import annotations

from dataclasses import replace

from sim_action.core.errors import Location
from sim_action.core.provenance import Provenance
from sim_action.results.outcome import Diagnostic, ExpectationOutcome, Failure, Measurement, Outcome, Repeats, Status
from sim_action.results.results_json import Results, Shard
from sim_action.scenario.source import Varied
from sim_action.state.timeline import TimeMark
from sim_action.state.verdict import Judged, Verdict
from sim_action.world.claims import AuditWarning
from tests.outcomes import like

STRAIGHT = "scenarios/straight.sim.yml"
WALL = "scenarios/wall.sim.yml"
CIRCLE = "scenarios/circle.sim.yml"

TRAVEL = ExpectationOutcome(
    name="travel at least 1.5 m",
    assertion="travel",
    severity="error",
    location=Location(STRAIGHT, 8, 5),
    verdict=Verdict(True, 1.5012, 1.5, 0.0012, "m", 2.0, "travelled 1.501 m in 2.00 s"),
)
SHORT = like(TRAVEL, verdict=Verdict(False, 1.12, 1.5, -0.38, "m", 30.0, "travelled 1.12 m of 1.5 m in 30.0 s"))
UPRIGHT = ExpectationOutcome(
    name="stays up",
    assertion="upright",
    severity="warning",
    location=Location(WALL, 14, 5),
    verdict=Verdict(False, 0.5236, 0.3491, -0.1745, "rad", 1.25, "tilted 30 deg at 1.25 s, more than 20 deg"),
)
TOUCHED = "base_link touched wall at 3.20 s, at (2.95, 0.00, 0.10) m, with 4.1 N"
COLLISION = ExpectationOutcome(
    name="no_collision",
    assertion="no_collision",
    severity="error",
    location=Location(WALL, 12, 5),
    verdict=Verdict(False, 1.0, 0.0, -1.0, "contacts", 3.2, TOUCHED),
)
ENDED = Verdict(False, 1.2, 1.5, -0.3, "m", 3.2, "travelled 1.2 m of 1.5 m in 3.2 s, when the run ended", cut_off=True)
CUT_OFF = like(TRAVEL, location=Location(WALL, 8, 5), verdict=ENDED)
NOTHING_TO_TOUCH = AuditWarning(
    rule="nothing-to-touch",
    message="the world has no objects, so the robot can touch nothing; add objects, or remove no_collision",
    location=Location(STRAIGHT, 9, 5),
)
ENDLESS = AuditWarning(
    rule="segment-beyond-run", message="for: 2000 s, and the run ends at 30 s", location=Location(STRAIGHT, 6, 7)
)
PASSED = Outcome(
    name="burger drives straight",
    file=STRAIGHT,
    status="passed",
    expectations=(TRAVEL,),
    end="goals met",
    sim_time=2.0,
    wall_time=0.412,
    real_time_factor=31.4,
    travelled=1.5012,
    digest="3f2a9c04d1" + "0" * 54,
    engine="PyBullet 3.2.7",
    notes=("recognised: diff drive, wheels 0.033 m, 0.16 m apart",),
    trace="traces/burger-drives-straight.npz",
)
HOSTILE = (
    'a|b <b>&</b> `x` @octocat #1 [l](http://x.y) *_~$ ]]> "q"\n::error::forged ##[error]x\x1b[31m \x00\u202e\ud800'
)

SKIPPED = Outcome(
    name="burger circles",
    file=CIRCLE,
    line=7,
    status="skipped",
    notes=("not run: another scenario did not pass (--fail-fast)",),
)


def variation(friction: float, yaw: str, status: Status, margin: float) -> Outcome:
    """Of one scenario, `push`."""
    short = Verdict(False, 1.5 + margin, 1.5, margin, "m", 30.0, f"travelled {1.5 + margin:.3g} m of 1.5 m in 30.0 s")
    return like(
        PASSED,
        name=f"push[friction={friction},yaw={yaw.replace(' ', '')}]",
        file="scenarios/push.sim.yml",
        group="push",
        variation=(Varied("world.ground.friction", friction), Varied("robot.pose.yaw", yaw)),
        status=status,
        expectations=(TRAVEL if status == "passed" else like(TRAVEL, verdict=short),),
    )


PROVENANCE = Provenance(
    cpu="AMD EPYC 7763 64-Core Processor",
    engine_build="pybullet 3.2.7, cp311-cp311-manylinux_2_17_x86_64, libraries 0123456789ab",
    sim_action="0.1.0",
    python="3.11.7",
    numpy="2.4.6",
    platform="Linux-x86_64",
)
DIFFERS = "3 of 5 runs agree; run 2 differs from run 1 at 0.3042 s, in x of base_position_xyz: 0.25 and not 0.26"
FLAKY = like(
    PASSED,
    name="burger wanders",
    status="flaky",
    expectations=(),
    repeats=Repeats(count=5, agreed=3, digests=2),
    provenance=PROVENANCE,
    failures=(Failure(kind="flaky", title="flaky", message=DIFFERS, time=0.3042),),
    notes=("the trace of run 1 is stored here, the trace of run 2 in traces/burger-wanders-2.npz",),
)
JUDGED_TRAVEL = like(TRAVEL, verdict=replace(TRAVEL.verdict, judged=Judged(240, 0.0, 1.0)))
NO_READING = "never checked: sensor 'lidar' had no reading; lower its rate or run for longer"
NEVER_READ = ExpectationOutcome(
    name="range stays above 0.2 m",
    assertion="sensor",
    severity="error",
    location=Location(WALL, 17, 5),
    verdict=Verdict(False, message=NO_READING, judged=Judged()),
)
UNREAD = like(
    PASSED, name="burger watches the wall", file=WALL, status="not_exercised", expectations=(JUDGED_TRAVEL, NEVER_READ)
)


def unread_variation(friction: float) -> Outcome:
    """Of one scenario, `push`."""
    return like(variation(friction, "0 deg", "passed", 0.0), status="not_exercised", expectations=(TRAVEL, NEVER_READ))


SAME_VERDICTS = ExpectationOutcome(
    name="the same verdicts as pybullet 3.2.7",
    assertion="agreement",
    severity="warning",
    location=Location(STRAIGHT, 1, 1),
    verdict=Verdict(True, message="judged as in pybullet 3.2.7"),
)
APART = Measurement(
    name="distance to pybullet 3.2.7",
    measured=0.00212,
    unit="m",
    time=0.52,
    message="position differs from pybullet 3.2.7 by at most 0.00212 m, at 0.52 s",
)

STEADY = variation(1.0, "0 deg", "passed", 0.0)
BROKEN_FILE, ODD_FILE = "scenarios/broken.sim.yml", "scenarios/a b|c,d:e%.sim.yml"


def error(name: str, file: str, *failures: Failure, wall_time: float = 0.0) -> Outcome:
    return Outcome(name=name, file=file, status="error", failures=failures, wall_time=wall_time)


def invalid(message: str, line: int, column: int) -> Failure:
    place = Location(BROKEN_FILE, line, column)
    return Failure(kind="invalid", title="invalid scenario", message=message, location=place)


_OUTCOMES: dict[str, tuple[Outcome, ...]] = {
    "passed": (PASSED,),
    "flaky": (
        like(PASSED, repeats=Repeats(count=5, agreed=5, digests=1), provenance=PROVENANCE),
        FLAKY,
        variation(0.4, "0 deg", "passed", 0.0),
        like(FLAKY, name=STEADY.name, file=STEADY.file, group=STEADY.group, variation=STEADY.variation),
    ),
    "failed": (
        like(
            PASSED,
            name="burger stops before the wall",
            file=WALL,
            status="failed",
            expectations=(TRAVEL, COLLISION, UPRIGHT, COLLISION),
            end="expectation failed",
            sim_time=3.2,
            diagnostics=(Diagnostic(level="warning", message="b3Warning: no inertial data for link, wheel"),),
            output="controller: wall ahead\ncontroller: full speed",
        ),
        PASSED,
        like(PASSED, status="failed", expectations=(SHORT,), end="time limit", sim_time=30.0, travelled=1.12),
    ),
    "cut": (
        like(
            PASSED,
            name="burger hits the wall",
            file=WALL,
            status="failed",
            expectations=(CUT_OFF, COLLISION),
            marks=(
                TimeMark(1.0, 1.2, "pushed with 8 N"),
                TimeMark(1.5, 1.5, "commanded 0.5 rad/s", is_planned=True),
                TimeMark(2.0, None, "motor of joint 'wheel_left_joint' is off"),
            ),
            end="expectation failed",
            sim_time=3.2,
        ),
    ),
    "warning": (like(PASSED, expectations=(TRAVEL, UPRIGHT)),),
    "audited": (
        like(PASSED, warnings=(NOTHING_TO_TOUCH, ENDLESS)),
        like(variation(0.4, "0 deg", "passed", 0.0), warnings=(NOTHING_TO_TOUCH,)),
        like(variation(0.8, "0 deg", "failed", -0.2), warnings=(NOTHING_TO_TOUCH, ENDLESS)),
    ),
    "compared": (
        like(PASSED, name="burger drives straight [pybullet]", engine="pybullet 3.2.7"),
        like(
            PASSED,
            name="burger drives straight [mujoco]",
            engine="mujoco 4.0.1",
            expectations=(TRAVEL, SAME_VERDICTS),
            measurements=(APART,),
        ),
    ),
    "not-exercised": (
        like(
            UNREAD,
            name="burger may miss readings",
            status="passed",
            expectations=(JUDGED_TRAVEL, like(NEVER_READ, unexercised="warn")),
        ),
        like(PASSED, expectations=(JUDGED_TRAVEL,)),
        UNREAD,
        like(
            UNREAD,
            name="burger hits the wall unseen",
            status="failed",
            expectations=(NEVER_READ, COLLISION, CUT_OFF),
            end="expectation failed",
            sim_time=3.2,
        ),
        variation(0.2, "0 deg", "passed", 0.0),
        unread_variation(0.4),
        unread_variation(0.6),
    ),
    "crash": (
        error(
            "burger falls apart",
            WALL,
            Failure(
                kind="crash",
                title="SIGSEGV",
                message="the process of this scenario was ended by SIGSEGV; sim time had come to 1.20 s",
                details="controller: wall ahead\n```\nnot the end of the fence",
            ),
            wall_time=0.71,
        ),
    ),
    "invalid": (
        error(
            "broken.sim.yml",
            BROKEN_FILE,
            invalid("'parsec' is not a unit of time; use one of: s, ms, us, min, h", 9, 13),
            invalid("'travl' is not an assertion; did you mean 'travel'?", 7, 5),
        ),
    ),
    "interrupted": (
        PASSED,
        error(
            "burger circles",
            CIRCLE,
            Failure(
                kind="interrupted", title="interrupted", message="the run was interrupted before this scenario ended"
            ),
        ),
    ),
    "hostile": (
        like(
            PASSED,
            name=HOSTILE,
            status="failed",
            expectations=(
                like(
                    SHORT,
                    name=HOSTILE,
                    verdict=Verdict(False, 1.0, 2.0, -1.0, "m", 1.0, HOSTILE),
                    location=Location(ODD_FILE, 3, 1),
                ),
            ),
            marks=(TimeMark(0.5, 0.5, HOSTILE),),
            warnings=(AuditWarning(rule=HOSTILE, message=HOSTILE, location=Location(HOSTILE, 3)),),
            notes=(HOSTILE,),
            output=f"[[ATTACHMENT|/etc/passwd]]\n[\x00[ATTACHMENT|/etc/shadow]]\n{HOSTILE}\n````\n</details>",
        ),
        error(
            HOSTILE,
            ODD_FILE,
            Failure(kind="script", title=HOSTILE, message=HOSTILE, details=f"{HOSTILE}\n````\n# no heading"),
        ),
    ),
    "missing": (
        PASSED,
        error(
            "circle.sim.yml",
            CIRCLE,
            Failure(
                kind="missing",
                title="no result",
                message="no shard returned a result for this scenario; check the jobs that should have run it",
            ),
        ),
        error(
            "shard 2 of 3",
            "",
            Failure(
                kind="missing",
                title="no results",
                message="shard 2 of 3 returned no results; 4 of 12 scenarios have none; check its job",
            ),
        ),
    ),
    "varied": (
        *(
            variation(friction, yaw, "failed" if friction < 0.5 else "passed", margin)
            for friction in (0.1, 0.8)
            for yaw, margin in (("-0.448 deg", -0.38), ("2.78 deg", -0.75))
        ),
        like(PASSED, line=12),
        *(
            like(variation(friction, "1 deg", "passed", 0.0), group="still", name=f"still[{friction}]")
            for friction in (1, 2)
        ),
    ),
    "skipped": (
        like(PASSED, status="failed", expectations=(SHORT,)),
        SKIPPED,
        variation(0.1, "1 deg", "failed", -0.1),
        like(SKIPPED, name="push[friction=0.2,yaw=1deg]", group="push"),
    ),
    "part": (PASSED,),
    "empty-part": (),
    "nothing": (),
}
_PARTS = {"part": Shard(index=1, count=3, total=2), "empty-part": Shard(index=3, count=3, total=2)}


def results_of(*outcomes: Outcome, shard: Shard | None = None) -> Results:
    """Return results of one call."""
    return Results(
        sim_action="0.1.0", python="3.11.7", platform="Linux-x86_64", wall_time=1.25, shard=shard, outcomes=outcomes
    )


SAMPLES = {kind: results_of(*outcomes, shard=_PARTS.get(kind)) for kind, outcomes in _OUTCOMES.items()}
"""Results of each kind, by its name."""
