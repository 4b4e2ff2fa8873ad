"""`ego: NAME`: another robot is under test, and the former one takes its place and its name.

So two files share a world with the roles turned round: the second one `extends` the first, and expects from its own
robot.
"""

from __future__ import annotations

from typing import Final

from sim_action.core.errors import Problem
from sim_action.core.records import replace
from sim_action.core.wording import did_you_mean
from sim_action.core.yaml_document import Document, KeyPath
from sim_action.scenario.part_reader import actors_of

KEY: Final = "ego"
_BESIDE: Final = ("commands", "sensors")  # the keys that stand beside `robot` in a scenario, and inside an actor


def with_roles(document: Document) -> tuple[Document, tuple[Problem, ...]]:
    """Return a document in which the robot that `ego` names is under test, with the problems of that key."""
    data = document.data
    if not isinstance(data, dict) or KEY not in data:
        return document, ()
    actors, name = actors_of(data), data[KEY]
    known = [actor["name"] for actor in actors or () if isinstance(actor, dict) and isinstance(actor.get("name"), str)]
    if not isinstance(name, str) or not isinstance(former := data.get("robot"), dict):
        return document, ()  # the reader of keys reports it
    if name not in known:
        hint = did_you_mean(name, known) if known else "; the world has no 'actors'"
        return document, (document.problem((KEY,), f"there is no robot '{name}' in world.actors{hint}"),)
    index = next(number for number, actor in enumerate(actors) if isinstance(actor, dict) and actor.get("name") == name)
    chosen, at = actors[index], ("world", "actors", index)
    beside = {key: data[key] for key in _BESIDE if key in data}
    if isinstance(former.get("sensors"), str):
        # Standard sensors; others stand beside the robot.
        beside.setdefault("sensors", former["sensors"])
    there = {"name": name, **{key: value for key, value in former.items() if key != "sensors"}, **beside}
    robot = {key: value for key, value in chosen.items() if key not in ("name", *_BESIDE)}
    if isinstance(chosen.get("sensors"), str):
        robot["sensors"] = chosen["sensors"]
    turned = {key: value for key, value in data.items() if key not in _BESIDE}
    turned |= {key: chosen[key] for key in _BESIDE if key in chosen and key not in robot}
    world = {**data["world"], "actors": (*actors[:index], there, *actors[index + 1 :])}
    moved: dict[KeyPath, KeyPath] = {("robot",): at, at: ("robot",), (*at, "name"): (KEY,)}
    for key in _BESIDE:
        moved |= {(key,): (*at, key), (*at, key): (key,)}
    turned |= {"robot": robot, "world": world}
    return replace(document, data=turned, moved={**document.moved, **moved}), ()
