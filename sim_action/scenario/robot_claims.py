"""The rules of the audit of claims that need the robot model. They judge single assertions; see `claim_audit.py`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Any, Final

from sim_action.core import units
from sim_action.core.yaml_document import KeyPath
from sim_action.robot.model.kinematics import link_of_frame
from sim_action.robot.model.robot_model import WORLD, Joint, Link, RobotModel
from sim_action.scenario.claim_audit import ClaimFinding, late_points, placed_leaves
from sim_action.scenario.model import Agreement, Scenario
from sim_action.world.scene import Scene

_OF_CONTACTS: Final = frozenset({"no_collision", "clearance", "contact", "stops_before"})
_OF_BASE: Final = frozenset(
    {"travel", "path_length", "reach", "stay_within", "upright", "max_speed", "final_pose", "follow_path"}
)
_MAX_LINKS: Final = 5


def audit_robot(
    scene: Scene, scenario: Scenario, expect_paths: Sequence[KeyPath], command_paths: Sequence[KeyPath]
) -> Iterator[ClaimFinding]:
    """Yield the findings about assertions that do not fit the robot, and waypoints of links that come too late."""
    yield from _late_waypoints(scene, scenario, command_paths)
    leaves = list(placed_leaves(scenario, expect_paths))
    for path, assertion in leaves:
        yield from _bare_joint_angles(path, assertion, scene.model)
    yield from _shapes(leaves, scene)
    if any(not getattr(assertion, "watches_base", True) for _, assertion in leaves):
        from sim_action.scenario.reach_claims import audit_reach

        yield from _rigid_links(leaves, scene)
        yield from audit_reach(leaves, scene)
    if scene.bolted:
        yield from _fixed_base(leaves)
        if scenario.agreement is not None:
            yield from _fixed_parts(scenario.agreement, scene)
    for path, assertion in leaves:
        yield from _own_limits(path, assertion, scene)


def _own_limits(path: KeyPath, assertion: Any, scene: Scene) -> Iterator[ClaimFinding]:
    """Yield the findings about the limits of a single assertion."""
    if assertion.key == "effort":
        yield from _clipped_efforts(path, assertion, scene.model)
    elif assertion.key == "clearance" and scene.bolted_links:
        yield from _fixed_distances(path, assertion, scene)
    elif assertion.key == "stl":
        from sim_action.scenario.formula_claims import audit_formula_of_robot

        yield from audit_formula_of_robot(path, assertion, scene)


def _late_waypoints(scene: Scene, scenario: Scenario, command_paths: Sequence[KeyPath]) -> Iterator[ClaimFinding]:
    for path, source in zip(command_paths, scenario.commands, strict=True):
        arrivals = getattr(source, "arrivals", None)
        if arrivals is not None:
            yield from late_points((*path, "pose", "waypoints"), arrivals(scene), scenario)


def _shapes(leaves: Sequence[tuple[KeyPath, Any]], scene: Scene) -> Iterator[ClaimFinding]:
    """Yield assertions about contacts of a robot without collision shapes, or with links that lack them.

    Only the engine knows the shapes of an MJCF model.
    """
    model = scene.model
    judged = [(path, assertion) for path, assertion in leaves if assertion.key in _OF_CONTACTS]
    if not judged or model.mjcf:
        return
    if not any(link.collisions for link in model.links):
        drawn = [link.name for link in model.links if link.visuals] or [model.root]
        for path, assertion in judged:
            message = f"no link of the robot has a collision shape; add <collision> to {_quoted(drawn)}"
            yield ClaimFinding("no-collision-shape", path, f"{assertion.key} checks nothing: {message}")
        return
    shaped = {link.name for link in model.links if link.collisions}
    for path, assertion in judged:
        if assertion.key == "no_collision" and shaped <= set(assertion.allow):
            message = "allow names every link with a collision shape, so no touch counts; remove links from allow"
            yield ClaimFinding("nothing-to-touch", path, message)
    # An assertion that names links judges only those.
    all_links = [path for path, each in judged if not (getattr(each, "links", None) or getattr(each, "link", None))]
    if all_links and (unseen := [link.name for link in _shapeless(scene)]):
        has = "links have" if len(unseen) > 1 else "link has"
        message = f"contacts of {_quoted(unseen)} are not seen: the {has} a visual shape, but no collision shape"
        yield ClaimFinding("shapeless-links", all_links[0], f"{message}; add <collision>")


def _clipped_efforts(path: KeyPath, assertion: Any, model: RobotModel) -> Iterator[ClaimFinding]:
    """Yield limits of efforts that the motors of all selected joints cannot exceed."""
    from sim_action.robot.model.joint_selection import chosen

    motors = [joint for joint in chosen(model, assertion.joints) if joint.mimic is None]
    # Without a limit in the model, or with a limit of 0, the effort is not limited.
    if not motors or not all(joint.max_effort for joint in motors):
        return
    for field in ("at_most", "rms_at_most"):
        written = getattr(assertion, field)
        try:
            limits = [] if written is None else [units.parse(written, joint.dimension("effort")) for joint in motors]
        except units.UnitError:
            continue  # reported by the assertion itself
        if limits and all(limit >= (joint.max_effort or 0.0) for limit, joint in zip(limits, motors, strict=True)):
            most = max(motors, key=lambda joint: joint.max_effort or 0.0)
            motor = f"{units.display(most.max_effort or 0.0, most.dimension('effort').si)} ('{most.name}')"
            message = f"this limit cannot be exceeded: the motors give at most {motor}; give a smaller limit"
            yield ClaimFinding("unreachable-limit", (*path, field), message)


def _fixed_base(leaves: Sequence[tuple[KeyPath, Any]]) -> Iterator[ClaimFinding]:
    """Yield assertions about the motion of a base that cannot move."""
    use = "judge a link with 'link', or its joints with joint or joint_within, or free the base"
    for path, assertion in leaves:
        if not getattr(assertion, "watches_base", True):
            continue
        if assertion.key in _OF_BASE:
            message = f"{assertion.key} judges the base of the robot, but it is fixed and never moves; {use}"
            yield ClaimFinding("fixed-base", path, message)
        elif assertion.key == "settled" and assertion.joints is False:
            message = "only the base must come to rest, but it is fixed and never moves; remove 'joints: false'"
            yield ClaimFinding("fixed-base", (*path, "joints"), message)
        elif assertion.key == "matches" and not assertion.joints:
            message = "only the base is compared, but it is fixed and never moves; add tolerances in 'joints'"
            yield ClaimFinding("fixed-base", path, message)


def _fixed_distances(path: KeyPath, assertion: Any, scene: Scene) -> Iterator[ClaimFinding]:
    """Yield a distance between named links and bodies that cannot move."""
    moving = {body.name for body in scene.world.objects if body.mass is not None or body.path}
    meant = {body.name for body in scene.world.objects} if assertion.to is None else set(assertion.to)
    if assertion.chosen and scene.bolted_links.issuperset(assertion.chosen) and moving.isdisjoint(meant):
        message = f"clearance checks nothing: neither {_quoted(assertion.chosen)} nor the bodies can move"
        yield ClaimFinding("fixed-base", path, f"{message}; name a link or a body that moves")


def _rigid_links(leaves: Sequence[tuple[KeyPath, Any]], scene: Scene) -> Iterator[ClaimFinding]:
    """Yield assertions about the motion of a link that no joint moves relative to its frame."""
    for path, assertion in leaves:
        if getattr(assertion, "watches_base", True):
            continue
        names = scene.model.links_by_name
        link, frame = assertion.link or scene.model.root, link_of_frame(scene.model, assertion.frame)
        if link not in names or (frame != WORLD and (link == frame or frame not in names)):
            continue  # reported by the assertion itself
        if assertion.key == "settled" and assertion.joints:
            continue
        if link in _held_with(frame, scene):
            message = f"link '{link}' never moves in the frame '{assertion.frame}': no joint is between them"
            use = "name a link or a frame that moves"
            yield ClaimFinding("fixed-base", path, f"{assertion.key} checks nothing: {message}; {use}")


def _held_with(frame: str, scene: Scene) -> frozenset[str]:
    """Return the links that never move relative to the world, or to a link."""
    if frame == WORLD or frame in scene.bolted_links:
        return scene.bolted_links
    bodies = (frozenset(link.name for link in body) for body in _rigid_bodies(scene.model))
    return next(names for names in bodies if frame in names)


def _fixed_parts(agreement: Agreement, scene: Scene) -> Iterator[ClaimFinding]:
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


def _shapeless(scene: Scene) -> list[Link]:
    bodies = [body for body in _rigid_bodies(scene.model) if scene.bolted_links.isdisjoint(link.name for link in body)]
    return [link for body in bodies if not any(each.collisions for each in body) for link in body if link.visuals]


def _rigid_bodies(model: RobotModel) -> list[list[Link]]:
    """Return the links in groups that fixed joints hold together."""
    holders = {joint.child: joint.parent for joint in model.joints if not joint.moves}
    bodies: dict[str, list[Link]] = {}
    for link in model.links:
        holder = link.name
        while holder in holders:
            holder = holders[holder]
        bodies.setdefault(holder, []).append(link)
    return list(bodies.values())


def _quoted(names: Sequence[str]) -> str:
    more = len(names) - _MAX_LINKS
    return ", ".join(f"'{name}'" for name in islice(names, _MAX_LINKS)) + (f" and {more} more" if more > 0 else "")


def _bare_joint_angles(path: KeyPath, assertion: Any, model: RobotModel) -> Iterator[ClaimFinding]:
    """Yield bare angles of joints that cannot make a full turn; other joints may turn many times."""
    for names, below, written in _joint_positions(assertion):
        from sim_action.robot.model.joint_selection import chosen

        if any(map(_is_limited, chosen(model, names))) and (problem := units.beyond_a_turn(written)) is not None:
            yield ClaimFinding("bare-angle", (*path, *below), problem)
    if assertion.key == "stl":
        from sim_action.assertions.temporal_logic.vacuity import bare_numbers

        for each in bare_numbers(assertion.parsed):
            joints = [model.joints_by_name.get(signal.joint) for signal in each.signals if signal.name == "position"]
            limited = any(joint is not None and _is_limited(joint) for joint in joints)
            if limited and (problem := units.beyond_a_turn(each.number)) is not None:
                yield ClaimFinding("bare-angle", path, problem)


def _joint_positions(assertion: Any) -> Iterator[tuple[tuple[str, ...], KeyPath, object]]:
    """Yield the joints, the keys and the written value of each joint position in an assertion."""
    if assertion.key == "joint" and assertion.reading == "position":
        for key in ("at_least", "at_most", "near", "tolerance"):
            yield (assertion.name,), (key,), getattr(assertion, key)
    elif assertion.key == "joint_within":
        for name, bounds in assertion.position.items():
            yield from (((name,), ("position", name, index), bound) for index, bound in enumerate(bounds))
    elif assertion.key == "matches":
        yield from (((name,), ("joints", name), tolerance) for name, tolerance in assertion.joints.items())


def _is_limited(joint: Joint) -> bool:
    return joint.type == "revolute" and joint.lower is not None and joint.upper is not None
