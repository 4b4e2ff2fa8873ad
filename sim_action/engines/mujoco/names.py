"""Names in MuJoCo: prefixes that keep robot and world apart, and messages with the user's names again."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Final

from sim_action.world.scene import Scene


def object_name(name: str) -> str:
    """Return the name of a body of the world in MuJoCo."""
    return f"object/{name}"


def engine_name(name: str) -> str:
    """Return the name of a link or a joint of the robot in MuJoCo."""
    return f"robot/{name}"


_ACTOR: Final = "actor/"


def actor_prefix(actor: str) -> str:
    """Return the prefix of all names of another robot in MuJoCo."""
    return f"{_ACTOR}{actor}/"


def actor_of(name: str) -> str:
    """Return the robot whose part has a name with its prefix; the names of robots have no slash."""
    return name.removeprefix(_ACTOR).partition("/")[0]


def with_user_names(message: str, scene: Scene) -> str:
    """Return a message of MuJoCo as one line, with the user's names of bodies, links and joints."""
    bodies = [(object_name(body.name), body.name) for body in scene.world.objects]
    robots = [("", "", scene), *((actor_prefix(name), f"{name}/", actor) for name, actor in scene.actors.items())]
    parts = [
        (prefix + engine_name(name), said + name)
        for prefix, said, robot in robots
        for name in (*robot.model.links_by_name, *robot.model.joints_by_name)
    ]
    return _renamed(" ".join(message.split()), [*bodies, *parts])


def _renamed(message: str, names: Iterable[tuple[str, str]]) -> str:
    """Replace MuJoCo's names, also of pieces such as "object/wall/0.3", by the user's."""
    known = dict(names)
    if not known:
        return message
    # A name may be the prefix of another one.
    either = "|".join(map(re.escape, sorted(known, key=len, reverse=True)))
    return re.sub(rf"'?({either})(?:/\d+(?:\.\d+)?)?'?(?![\w/])", lambda found: f"'{known[found[1]]}'", message)
