"""Whether a robot can begin where a scenario puts it: what begins inside something else is thrown out of it.

An engine takes two bodies apart that are in each other, the faster the deeper they are: 2 cm throw a TurtleBot3 back by
4 cm, 12 cm at 5 m/s, and what is measured after that says nothing about the robot.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from sim_action import units
from sim_action.errors import BadStart
from sim_action.observation import Overlap
from sim_action.scene import Scene, SpecProblems
from sim_action.world import GROUND

DEPTH: Final = 0.005
"""In m. What is no deeper was meant to touch, as fingers do, and is eased apart while the robot settles."""


def refuse_bad_start(scene: Scene, overlaps: Iterable[Overlap]) -> None:
    """Raises BadStart if the robot, which has just been put in its place, is inside something."""
    problems = tuple(_problems(scene, overlaps))
    if problems:
        raise BadStart(problems)


def _problems(scene: Scene, overlaps: Iterable[Overlap]) -> SpecProblems:
    """One for each body, about the link that is deepest in it."""
    indices = {body.name: index for index, body in enumerate(scene.world.objects)}
    fixed = {GROUND, *(body.name for body in scene.world.objects if body.mass is None)}
    bolted = _bolted_links(scene)
    told = set[str]()
    for link, body, depth in sorted(overlaps, key=lambda overlap: -overlap.depth):
        if depth <= DEPTH or body in told or (link in bolted and body in fixed):
            continue
        told.add(body)
        where = f"the robot's link '{link}' begins {units.display(depth, 'm')} deep in "
        if body == GROUND:
            or_not = "" if scene.robot.pose.z is None else ", or leave z out: then it stands on the ground"
            yield ("robot", "pose"), f"{where}the ground; raise its z{or_not}"
        else:
            yield ("robot", "pose"), f"{where}'{body}'; move it, or world.objects[{indices[body]}].pose"


def _bolted_links(scene: Scene) -> set[str]:
    """What no force moves: the engine leaves it where it is, as the author of a robot's foot in a table wants it."""
    if not scene.bolted:
        return set()
    bolted = {scene.model.root}
    waiting = [scene.model.root]
    while waiting:
        parent = waiting.pop()
        held = [joint.child for joint in scene.model.joints if joint.parent == parent and not joint.moves]
        bolted.update(held)
        waiting += held
    return bolted
