"""Checks of a whole scenario that no single key can do, and the audit of its claims before a run.

The rules of the audit, and what each part yields, are in `world/claims.py`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from sim_action.assertions import Assertion
from sim_action.core import units
from sim_action.core.errors import Problem
from sim_action.core.geometry import Pose
from sim_action.core.records import replace
from sim_action.core.units import rate_divides
from sim_action.core.wording import FirstFew, did_you_mean, quoted
from sim_action.core.yaml_document import KeyPath, SpecProblems, dotted
from sim_action.drives import recognise, why_not_recognised
from sim_action.robot.model.findings import ALLOWABLE, RULES
from sim_action.robot.model.joint_selection import groups_of, joints_set_by, setting_problems, tolerance_problems
from sim_action.robot.model.kinematics import beyond_limits, why_no_link
from sim_action.robot.model.robot_model import NO_PAIRS, WORLD, Link, RobotModel, rigid_bodies, touchable_pairs
from sim_action.scenario.model import MAX_COMPARED_STEPS, Agreement, Expectation, Scenario, common_rate
from sim_action.scenario.source import Source
from sim_action.scenario.variations.gate import GATE, PlannedGate, Quantile
from sim_action.sensors import MountedSensor
from sim_action.state.timeline import late_problems
from sim_action.world import GROUND
from sim_action.world.claims import HEADINGS, ORIENTATIONS, ClaimFinding, Findings, Setting, beyond
from sim_action.world.physics import MAX_PHYSICS_RATE_HZ
from sim_action.world.scene import EGO, Scene

_TIME_ROUNDING: Final = 1e-9
_EDGE: Final = 1e-9  # m: patches that share an edge do not lie on each other
_MAX_KEPT: Final = 500_000_000  # Bytes of all sensors in a trace. They are copied several times before they are stored.


def time_problems(scenario: Scenario, expect_paths: Sequence[KeyPath]) -> SpecProblems:
    """Yield times that contradict each other."""
    limit = scenario.time_limit
    if scenario.duration is not None and scenario.duration > limit:
        yield ("duration",), f"must not be longer than time_limit ({limit:g} s)"
    if limit * scenario.physics.rate < 1:
        yield ("time_limit",), f"must not be shorter than a physics step (1 / {scenario.physics.rate:g} s)"
    for path, expectation in zip(expect_paths, scenario.expect, strict=True):
        if expectation.before != float("inf") and expectation.before > limit:
            yield (*path, "before"), f"{expectation.before:g} s is later than time_limit ({limit:g} s)"
        yield from late_problems((*path, "after"), expectation.after, limit)
        first = max(1, scenario.steps(expectation.after)) / scenario.physics.rate
        if expectation.after < expectation.before < first - _TIME_ROUNDING:
            yield (*path, "before"), f"too early: the first physics step in the window is at {first:.4g} s"
        for below, message in _horizon_problems(expectation, limit):
            yield (*path, *below), message


def _horizon_problems(expectation: Expectation, time_limit: float) -> SpecProblems:
    """Yield the problem of an expectation that must see more than its window has."""
    after, key = expectation.after, expectation.assertion.key
    needed, key = max((expectation.assertion.horizon, key), (expectation.span or 0.0, "for"), key=lambda time: time[0])
    name, end = min(("before", expectation.before), ("time_limit", time_limit), key=lambda bound: bound[1])
    if after < end < after + needed - _TIME_ROUNDING:
        since = f" from 'after' ({after:g} s) on" if after else ""
        fix = f"raise {name}, or shorten the time that it must see"
        yield (key,), f"must see {needed:g} s{since}, and {name} is {end:g} s; {fix}"


def rate_problems(
    scenario: Scenario, command_paths: Sequence[KeyPath], sensor_paths: Sequence[KeyPath]
) -> SpecProblems:
    """Yield rates whose ticks fall between physics steps."""
    physics = scenario.physics.rate
    ticking = [source.needed_rate for source in scenario.commands] + [sensor.rate for sensor in scenario.sensors]
    rates: list[tuple[KeyPath, float | None]] = [
        ((*path, "rate"), rate) for path, rate in zip((*command_paths, *sensor_paths), ticking, strict=True)
    ]
    rates.append((("trace", "rate"), scenario.trace.rate))
    for path, rate in rates:
        if rate is not None and not rate_divides(physics, rate):
            # The next lower and higher rate that fall on whole steps, whole hertz first.
            whole = [float(hertz) for hertz in range(1, int(physics) + 1) if rate_divides(physics, hertz)]
            candidates = whole or [physics / steps for steps in range(1, 1000)]
            below = max((hertz for hertz in candidates if hertz < rate), default=None)
            above = min((hertz for hertz in candidates if hertz > rate), default=None)
            near = " and ".join(f"{hertz:g} Hz" for hertz in (below, above) if hertz is not None)
            remedy = common_rate(scenario.needed_rates, physics, MAX_PHYSICS_RATE_HZ)
            faster = "" if remedy is None else f"; or set physics: {{rate: {remedy:.10g} Hz}}"
            yield path, f"{rate:g} Hz does not divide physics.rate, {physics:g} Hz; nearest: {near}{faster}"


def transmission_problems(
    scenario: Scenario, command_paths: Sequence[KeyPath], sensor_paths: Sequence[KeyPath]
) -> SpecProblems:
    """Yield delays of commands and readings that would last until the end of the run."""
    limit = scenario.time_limit
    senders = [
        *(
            (path, source, "no command would take effect")
            for path, source in zip(command_paths, scenario.commands, strict=True)
        ),
        *(
            (path, sensor.transmission, "no reading after t = 0 would arrive")
            for path, sensor in zip(sensor_paths, scenario.sensors, strict=True)
        ),
    ]
    for path, sent, result in senders:
        if sent.latency >= limit:
            message = f"{sent.latency:g} s is not shorter than time_limit ({limit:g} s), so {result}"
            yield (*path, "latency"), f"{message}; lower it, or raise time_limit"
        elif (longest := sent.latency + sent.jitter) >= limit:
            message = f"the delay can be {longest:g} s, which is not shorter than time_limit ({limit:g} s)"
            yield (*path, "jitter"), f"{message}; lower 'latency' or 'jitter', or raise time_limit"


def trace_problems(scenario: Scenario, sensor_paths: Sequence[KeyPath]) -> SpecProblems:
    """Yield cameras whose pictures do not fit into a trace."""
    kept = 0.0
    for path, mounted in zip(sensor_paths, scenario.sensors, strict=True):
        size = mounted.sensor.reading_bytes * mounted.rate * scenario.time_limit if mounted.trace else 0.0
        kept += size
        if size and kept > _MAX_KEPT:
            what = f"until time_limit ({scenario.time_limit:g} s) its readings take {size / 1e6:.0f} MB"
            yield (
                (*path, "trace"),
                f"{what}; a trace holds {_MAX_KEPT / 1e6:.0f} MB for all sensors; use fewer or smaller pictures",
            )


def reading_problems(scenario: Scenario, expect_paths: Sequence[KeyPath]) -> SpecProblems:
    """Yield assertions about missing sensors or about readings that a sensor does not have."""
    kinds = {mounted.name: mounted.sensor.key for mounted in scenario.sensors}
    for path, expectation in zip(expect_paths, scenario.expect, strict=True):
        for below, message in expectation.assertion.sensor_problems(kinds):
            yield (*path, expectation.assertion.key, *below), message


def engine_problems(scenario: Scenario) -> SpecProblems:
    """Yield a `backend` that contradicts `agreement`, and a run that is too long for it."""
    if scenario.agreement is not None and scenario.backend != "auto":
        yield ("backend",), "remove it: 'agreement' runs the scenario on every engine"
    if scenario.agreement is not None and not scenario.is_comparable:
        steps = f"time_limit has {scenario.steps(scenario.time_limit):,}"
        yield ("agreement",), f"compares at most {MAX_COMPARED_STEPS:,} physics steps, and {steps}; lower time_limit"


def compared_body_problems(scenario: Scenario) -> SpecProblems:
    """Yield bodies in `agreement` that do not exist, or that no engine moves."""
    if scenario.agreement is None:
        return
    bodies = {body.name: body for body in scenario.world.objects}
    hinted = FirstFew()
    for name in scenario.agreement.bodies:
        path: KeyPath = ("agreement", "bodies", name)
        actors = [actor.name for actor in scenario.world.actors]
        if name not in bodies and name not in actors:
            free = [*actors, *(body.name for body in scenario.world.objects if body.mass is not None)]
            yield path, f"the world has no body '{name}'{did_you_mean(name, free) if hinted.one_more() else ''}"
        elif name in bodies and bodies[name].mass is None:
            why = "follows its path" if bodies[name].path else "is fixed"
            yield path, f"body '{name}' {why}, so it is at the same place in every engine; remove it, or give it a mass"


def agreement_problems(scene: Scene, agreement: Agreement) -> SpecProblems:
    """Yield joints and links in `agreement` that the robot does not have, and units that do not fit the joints."""
    for path, message in tolerance_problems(scene.model, agreement.joints):
        yield ("agreement", "joints", *path), message
    for name in groups_of(scene.model).keys() & agreement.joints.keys() - scene.model.joints_by_name.keys():
        yield ("agreement", "joints", name), f"'{name}' is a group of the SRDF: name joints, or a pattern"
    hinted = FirstFew()
    for name in agreement.links:
        if name not in scene.model.links_by_name:
            hint = did_you_mean(name, scene.model.links_by_name) if hinted.one_more() else ""
            yield ("agreement", "links", name), f"the robot has no link '{name}'{hint}"


def recorded_link_problems(scenario: Scenario, model: RobotModel) -> SpecProblems:
    """Yield links in `trace.links` that the robot does not have."""
    if not scenario.trace.links:
        return
    # Few scenarios record links.
    for index, name in enumerate(scenario.trace.links):
        if (problem := why_no_link(model, name)) is not None:
            yield ("trace", "links", index), problem


def name_problems(scenario: Scenario) -> SpecProblems:
    """Yield bodies and other robots with the same name."""
    names = [GROUND, *(body.name for body in scenario.world.objects)]
    for index, name in enumerate(names):
        if name in names[:index]:
            yield ("world", "objects", index - 1, "name"), f"a second body named '{name}'; names are unique"
    for index, actor in enumerate(scenario.world.actors):
        path: KeyPath = ("world", "actors", index, "name")
        if actor.name == EGO:
            yield path, f"'{EGO}' is the robot under test; give this one another name"
        elif actor.name in names:
            yield path, f"'{actor.name}' is already the name of a body or of another robot; names are unique"
        names.append(actor.name)


def patch_problems(scenario: Scenario) -> SpecProblems:
    """Yield overlapping patches of the ground, whose friction would be ambiguous."""
    patches = scenario.world.patches
    for index, patch in enumerate(patches):
        if patch.appears is not None:
            where: KeyPath = ("world", "patches", index, "appears")
            yield from late_problems(where, patch.appears, scenario.time_limit)
            if not scenario.world.ground.friction:
                yield where, "the ground has no friction before, so a patch of it cannot get one; state a small one"
        for other, before in enumerate(patches[:index]):
            bounds = zip(patch.bounds, before.bounds, strict=True)
            if all(low < end - _EDGE and start < high - _EDGE for (low, high), (start, end) in bounds):
                yield ("world", "patches", index), f"lies on world.patches[{other}]; move one, or make it smaller"


def sensor_problems(scene: Scene, sensors: Sequence[MountedSensor], paths: Sequence[KeyPath]) -> SpecProblems:
    """Yield sensors with missing links or repeated names, and the problems of each sensor itself."""
    names: set[str] = set()
    for path, mounted in zip(paths, sensors, strict=True):
        if mounted.name in names:
            yield path, f"a second sensor named '{mounted.name}'; give each a 'name' of its own"
        names.add(mounted.name)
        if mounted.link is not None and mounted.link not in scene.model.links_by_name:
            hint = did_you_mean(mounted.link, scene.model.links_by_name)
            yield (*path, "link"), f"the robot has no link '{mounted.link}'{hint}"
        if mounted.sensor.reads_wheels and (mounted.link is not None or mounted.pose != Pose()):
            where = "pose" if mounted.link is None else "link"
            yield (*path, where), f"'{mounted.sensor.key}' is of the base link by its wheels; leave '{where}' out"
        for below, message in mounted.sensor.problems(scene):
            yield (*path, mounted.sensor.key, *below), message


def robot_problems(scenario: Scenario, model: RobotModel) -> SpecProblems:
    """Yield a base that cannot move, missing joints, invalid start positions and a drive that does not fit."""
    robot = scenario.robot
    if robot.base == "free" and model.mjcf is not None and model.root == WORLD:
        message = "the file fixes the robot to the world, so that it has no base to free: give its body a <freejoint>"
        yield ("robot", "base"), message
    if robot.base != "fixed" and model.root != WORLD and (trouble := _weightless(model, robot.allow)) is not None:
        yield ("robot", "model"), trouble
    if robot.joints:
        yield from _start_position_problems(robot.joints, model)
    if robot.self_collision:
        yield from _self_collision_problems(model)
    if robot.drive is not None:
        for below, message in robot.drive.problems(model):
            yield ("robot", "drive", robot.drive.key, *below), message


def _self_collision_problems(model: RobotModel) -> SpecProblems:
    if next(touchable_pairs(model), None) is None:
        yield ("robot", "self_collision"), f"it has no effect: {NO_PAIRS}; remove it"


def _start_position_problems(positions: Mapping[str, float | str], model: RobotModel) -> SpecProblems:
    """Yield missing joints, patterns that match nothing, and invalid start positions."""
    for below, message in setting_problems(model, positions, FirstFew()):
        yield ("robot", "joints", *below), message
    for name, names in joints_set_by(model, positions).items():
        for joint in names:
            if (trouble := _start_position_problem(joint, positions[name], model)) is not None:
                yield ("robot", "joints", name), trouble if joint == name else f"joint '{joint}': {trouble}"


def _start_position_problem(name: str, written: float | str, model: RobotModel) -> str | None:
    joint = model.joints_by_name.get(name)
    if joint is None or not joint.ball:
        hint = f"; it starts at {name}_x, {name}_y and {name}_z" if name in model.balls else ""
        if (trouble := model.why_not_driven(name)) is not None:
            return f"{trouble}{hint}"
    assert joint is not None
    try:
        return beyond_limits(joint, units.parse(written, joint.dimension("position")))
    except units.UnitError as error:
        return str(error)


def _weightless(model: RobotModel, allowed: Sequence[str]) -> str | None:
    """Return a message if the base of a model could not move freely because of its mass, else None."""
    if model.links_by_name[model.root].mass == 0:
        message = f"the base link '{model.root}' has no mass, so the engine would hold it still"
        return f"{message}; say base: fixed, or give it a mass"
    if model.mass or "massless-model" in allowed:
        return None
    message = "no link of the model has a mass, so it cannot move freely"
    return f"{message}; say base: fixed, add <inertial> to the links, or allow massless-model"


def follower_problems(scene: Scene) -> SpecProblems:
    """Yield mimic joints that would start outside their limits and stay there."""
    model, stated = scene.model, scene.robot.joints
    try:
        positions = scene.joint_positions
    except units.UnitError:
        return
    if not any(joint.mimic for joint in model.moving_joints):
        return
    setters = {joint_name: name for name, names in joints_set_by(model, stated).items() for joint_name in names}
    for joint in model.moving_joints:
        leader = joint
        while leader.mimic is not None:
            leader = model.joints_by_name[leader.mimic.joint]
        message = beyond_limits(joint, positions[joint.name]) if leader is not joint else None
        if message is not None:
            path: KeyPath = ("robot", "joints", setters[leader.name]) if leader.name in setters else ("robot",)
            about = f"joint '{joint.name}', which follows '{leader.name}', would begin beyond its own limits"
            yield path, f"{about}: {message}"


def rule_problems(scenario: Scenario) -> SpecProblems:
    """Yield unknown rules in `robot.allow` and rules that cannot be allowed."""
    hinted = FirstFew()
    for index, name in enumerate(scenario.robot.allow):
        # A rule whose findings are notes needs no permission; it may have needed one before.
        if name not in RULES or RULES[name].level == "fatal":
            path: KeyPath = ("robot", "allow", index)
            hint = "; no engine accepts such a model" if name in RULES else ""
            if not hint and hinted.one_more():
                hint = did_you_mean(name, ALLOWABLE)
            yield path, f"'{name}' is not a rule that can be allowed{hint}"


def wheel_problems(scenario: Scenario, scene: Scene, sensor_paths: Sequence[KeyPath]) -> SpecProblems:
    """Yield twists and wheel odometry for a robot whose drive is neither given nor recognised."""
    drives = any(source.gives_twists(scene) for source in scenario.commands)
    sensors = zip(sensor_paths, scenario.sensors, strict=True)
    odometry = [(*path, mounted.sensor.key) for path, mounted in sensors if mounted.sensor.reads_wheels]
    if (drives or odometry) and recognise(scene.model) is None:
        message = _drives_nothing(scene.model) if drives and scene.bolted else _no_wheels(scene.model)
        yield from ((path, message) for path in ([("robot",)] if drives else odometry))


def _drives_nothing(model: RobotModel) -> str:
    joint = next((joint.name for joint in model.moving_joints), "JOINT")
    return (
        f"'{model.name}' is fixed to the world and has no wheels, so no twist can drive it; command its joints, such "
        f"as commands: {{joints: [{{at: 1 s, position: {{{joint}: 0.5}}}}]}}"
    )


def _no_wheels(model: RobotModel) -> str:
    moving = [joint.name for joint in model.moving_joints]
    return (
        f"it is not plain from '{model.name}' which joints are wheels; name them, such as "
        f"drive: {{diff: {{left: [...], right: [...]}}}}; its moving joints: {', '.join(moving) or 'none'}; "
        f"the most likely reason: {why_not_recognised(model)[0]}"
    )


def source_problems(scenario: Scenario, scene: Scene, command_paths: Sequence[KeyPath]) -> SpecProblems:
    """Yield sources that begin after the end, or move the same joint at the same time, as far as known before."""
    wheels = _wheels(scenario, scene.model)
    owners: dict[str, KeyPath] = {}
    driver: KeyPath | None = None
    waiting = {place for event in scenario.events for place in event.starts}
    for index, (path, source) in enumerate(zip(command_paths, scenario.commands, strict=True)):
        below, begins = source.begins
        if begins >= scenario.time_limit:
            yield (*path, *below), f"{begins:g} s is not earlier than time_limit ({scenario.time_limit:g} s)"
        if index in waiting:
            # An event may stop the other one first.
            continue
        if source.gives_twists(scene):
            if driver is not None:
                yield path, f"{dotted(driver)} drives the base already; one source at a time does"
                continue
            driver = path
        moved = source.joints(scene) | (wheels if source.gives_twists(scene) else frozenset())
        for joint in sorted(moved):
            if (owner := owners.setdefault(joint, path)) is not path:
                message = f"joint '{joint}' is moved by {dotted(owner)} already"
                yield path, f"{message}; command sources must move different joints"
                break


def _wheels(scenario: Scenario, model: RobotModel) -> frozenset[str]:
    """Return the joints that twists turn; empty if they are unknown, which another check reports."""
    drive = scenario.robot.drive or recognise(model)
    if drive is None or any(drive.problems(model)):
        return frozenset()
    return drive.open(model, scenario.physics.rate).joints


def environment_problems(scenario: Scenario) -> SpecProblems:
    """Yield a problem if variables are set although no code reads them: the run's process would have them."""
    if scenario.environment and not scenario.runs_user_code:
        code = "script, process, assertion, xacro or ROS nodes"
        yield ("environment",), f"nothing in this scenario runs code that could read variables ({code}); remove it"


_REMEDY: Final = (
    "draw a key in 'variations', such as world.ground.friction: {uniform: [0.05, 0.8]}, or give a sensor 'noise'"
)


def gate_problems(gate: PlannedGate, source: Source, scenario: Scenario) -> Iterator[Problem]:
    """Yield the problems of the gate of a scenario; its file may be a base of the scenario."""
    if source.differs_by_seed and not scenario.is_random:
        yield Problem(gate.location, _equal_runs(gate, source.equal_draws))
    for claim in gate.gate.quantile:
        if (text := _other_unit(claim, scenario)) is not None:
            yield Problem(gate.location, text)


def _equal_runs(gate: PlannedGate, draws: tuple[str, ...]) -> str:
    keys = " and ".join(f"'{key}'" for key in draws)
    reason = f"all samples of {keys} have one value" if keys else "nothing is drawn"
    return f"{GATE}: all {gate.runs} runs would be the same: {reason} and nothing is noisy; {_REMEDY}"


def _other_unit(claim: Quantile, scenario: Scenario) -> str | None:
    """Return the problem of a limit in another unit than the measured value; None if either unit is not known."""
    _, stated = units.with_si_unit(claim.bound)
    named = [expectation for expectation in scenario.expect if expectation.name == claim.expectation]
    matches = named or [
        expectation for expectation in scenario.expect if claim.expectation == expectation.assertion.key
    ]
    if not stated or len(matches) != 1 or not (possible := _units_of(matches[0])) or stated in possible:
        return None
    unit = possible[0]
    return f"{GATE}.quantile: {claim.of} is in {unit}, and the limit is {claim.bound}; write it in {unit}"


def _units_of(expected: Expectation) -> tuple[str, ...]:
    unit = expected.assertion.measured_unit
    # A goal that must hold for a time, or was true from the beginning, measures this time.
    return () if unit is None else (unit, units.TIME.si) if expected.assertion.is_goal else (unit,)


def audit_scenario(
    scenario: Scenario, expect_paths: Sequence[KeyPath], command_paths: Sequence[KeyPath]
) -> Iterator[ClaimFinding]:
    """Yield the findings that are visible without the robot model."""
    if all(expectation.severity == "warning" for expectation in scenario.expect):
        yield from _warnings_only(scenario, expect_paths)
    if scenario.agreement is not None:
        yield from _beyond_half_a_turn(scenario.agreement)
    for path, expectation in zip(expect_paths, scenario.expect, strict=True):
        end = min(scenario.time_limit, expectation.before)
        setting = Setting(scenario.world, scenario.physics, scenario.time_limit, end)
        for place, leaf in expectation.assertion.placed_leaves():
            yield from _below((*path, *place), leaf.claims(setting), expectation)
    setting = _setting_of_commands(scenario)
    for path, source in zip(command_paths, scenario.commands, strict=True):
        yield from _below(path, source.claims(setting))
    for index, disturbance in enumerate(scenario.world.disturbances):
        for message in disturbance.claims():
            yield ClaimFinding("no-effect", ("world", "disturbances", index), message)
    yield from _unread_sensors(scenario)


def audit_robot(
    scene: Scene, scenario: Scenario, expect_paths: Sequence[KeyPath], command_paths: Sequence[KeyPath]
) -> Iterator[ClaimFinding]:
    """Yield the findings that need the robot model, or other files."""
    setting = _setting_of_commands(scenario)
    for path, source in zip(command_paths, scenario.commands, strict=True):
        yield from _below(path, source.robot_claims(scene, setting))
    leaves = [
        ((*path, *place), leaf, expectation)
        for path, expectation in zip(expect_paths, scenario.expect, strict=True)
        for place, leaf in expectation.assertion.placed_leaves()
    ]
    for rule in ("no-collision-shape", "shapeless-links"):
        judged = [(path, leaf) for path, leaf, whose in leaves if leaf.sees_shapes and rule not in whose.allow]
        yield from (finding for finding in _without_shapes(judged, scene) if finding.rule == rule)
    for path, leaf, expectation in leaves:
        yield from _below(path, leaf.robot_claims(scene), expectation)
    if scene.bolted and scenario.agreement is not None:
        yield from _fixed_parts(scenario.agreement, scene)


def audit_combination(path: KeyPath, expectation: Expectation, scene: Scene) -> Findings:
    """Yield the findings on a combined assertion as a whole."""
    yield from _below(path, expectation.assertion.combined_claims(scene), expectation)


def _below(path: KeyPath, findings: Findings, of: Expectation | None = None) -> Findings:
    """Yield findings on a part at `path`, except findings that its expectation allows."""
    return (finding.below(path) for finding in findings if of is None or finding.rule not in of.allow)


def _setting_of_commands(scenario: Scenario) -> Setting:
    """Return the setting of the commands: without a goal, the run ends at its `duration`."""
    setting = Setting(scenario.world, scenario.physics, scenario.time_limit, scenario.time_limit)
    if scenario.duration is None or any(expected.assertion.is_goal for expected in scenario.expect):
        return setting
    windows = (
        (expected.after + expected.assertion.horizon, expected.before if math.isfinite(expected.before) else 0.0)
        for expected in scenario.expect
    )
    end = max(scenario.duration, *(max(window) for window in windows))
    return replace(setting, end=end, end_key="duration") if end < scenario.time_limit else setting


def _unread_sensors(scenario: Scenario) -> Findings:
    """Yield noisy or delayed sensors that no assertion, no controller and no recording reads."""
    if scenario.runs_user_code or not all(source.is_written for source in scenario.commands):
        return
    read = {name for expected in scenario.expect for name in expected.channels.sensors}
    for index, mounted in enumerate(scenario.sensors):
        disturbed = mounted.sensor.is_random or not mounted.transmission.is_perfect
        if disturbed and mounted.name not in read and not mounted.trace:
            message = f"nothing reads sensor '{mounted.name}', so its noise and its delays have no effect"
            yield ClaimFinding("no-effect", ("sensors", index), f"{message}; use it in 'expect', or remove it")


def _warnings_only(scenario: Scenario, expect_paths: Sequence[KeyPath]) -> Findings:
    if scenario.agreement is None and expect_paths:
        message = "every expectation has severity: warning, so this scenario cannot fail; remove it from one of them"
        yield ClaimFinding("warnings-only", (*expect_paths[0], "severity"), message)


def _beyond_half_a_turn(agreement: Agreement) -> Findings:
    """Yield angles of `agreement` that no two runs exceed."""
    if agreement.yaw is not None and agreement.yaw >= math.pi:
        yield beyond(("agreement", "yaw"), agreement.yaw, "rad", HEADINGS)
    for group, named in (("links", agreement.links), ("bodies", agreement.bodies)):
        for name, limits in named.items():
            if limits.orientation is not None and limits.orientation >= math.pi:
                yield beyond(("agreement", group, name, "orientation"), limits.orientation, "rad", ORIENTATIONS)


def _without_shapes(judged: Sequence[tuple[KeyPath, Assertion]], scene: Scene) -> Findings:
    """Yield assertions about contacts of a robot, or links, without shapes; only the engine knows shapes of MJCF."""
    model = scene.model
    if not judged or model.mjcf:
        return
    if not any(link.collisions for link in model.links):
        drawn = [link.name for link in model.links if link.visuals] or [model.root]
        for path, assertion in judged:
            message = f"no link of the robot has a collision shape; add <collision> to {quoted(drawn)}"
            yield ClaimFinding("no-collision-shape", path, f"{assertion.key} checks nothing: {message}")
        return
    # An assertion that names links judges only those.
    of_all_links = [path for path, assertion in judged if not assertion.names_links]
    if of_all_links and (unseen := [link.name for link in _shapeless(scene)]):
        has = "links have" if len(unseen) > 1 else "link has"
        message = f"contacts of {quoted(unseen)} are not seen: the {has} a visual shape, but no collision shape"
        yield ClaimFinding("shapeless-links", of_all_links[0], f"{message}; add <collision>")


def _shapeless(scene: Scene) -> list[Link]:
    """Return the drawn links of the rigid bodies that can move and have no collision shape."""
    holders = rigid_bodies(scene.model)
    bodies: dict[str, list[Link]] = {}
    for link in scene.model.links:
        bodies.setdefault(holders[link.name], []).append(link)
    moving = [body for body in bodies.values() if scene.bolted_links.isdisjoint(link.name for link in body)]
    return [link for body in moving if not any(link.collisions for link in body) for link in body if link.visuals]


def _fixed_parts(agreement: Agreement, scene: Scene) -> Findings:
    """Yield limits of `agreement` for parts of a fixed robot that are at the same place in every engine."""
    joint = next((joint.name for joint in scene.model.moving_joints), "*")
    unit = "1 cm" if joint != "*" and scene.model.joints_by_name[joint].type == "prismatic" else "0.5 deg"
    use = f"limit its joints or links, such as joints: {{{joint if joint != '*' else repr(joint)}: {unit}}}"
    if keys := [key for key in ("position", "yaw") if getattr(agreement, key) is not None]:
        what = f"'{keys[0]}' compares" if len(keys) == 1 else "'position' and 'yaw' compare"
        message = f"{what} the base of the robot, but it is fixed and never moves; {use}"
        yield ClaimFinding("fixed-base", ("agreement", keys[0]), message)
    for name in agreement.links:
        if name in scene.bolted_links:
            message = f"link '{name}' is fixed to the world and never moves; name a link that moves, or remove it"
            yield ClaimFinding("fixed-base", ("agreement", "links", name), message)
