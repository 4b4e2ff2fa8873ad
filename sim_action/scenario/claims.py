"""The audit of claims before a run: collects the findings of all parts, and judges the scenario as a whole.

The rules, and what each part yields, are in `world/claims.py`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from sim_action.assertions import Assertion
from sim_action.core.records import replace
from sim_action.core.wording import quoted
from sim_action.core.yaml_document import KeyPath
from sim_action.robot.model.robot_model import Link, rigid_bodies
from sim_action.scenario.model import Agreement, Expectation, Scenario
from sim_action.world.claims import HEADINGS, ORIENTATIONS, ClaimFinding, Findings, Setting, beyond
from sim_action.world.scene import Scene


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
    """Yield findings on a part at `path`, without those that its expectation allows."""
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
    """Yield assertions about contacts of a robot, or links, without shapes; the engine alone knows those of MJCF."""
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
