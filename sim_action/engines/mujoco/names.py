"""What the engine says, in the words of the scenario: in the engine, everything has a name of ours."""

from __future__ import annotations

import re
from collections.abc import Iterable

from sim_action.world.scene import Scene


def object_name(name: str) -> str:
    """What a body of the world is called in the engine."""
    return f"object/{name}"


def engine_name(name: str) -> str:
    """What a link or a joint is called in the engine, where the world has names too."""
    return f"robot/{name}"


def in_users_words(message: str, scene: Scene) -> str:
    """One line, in which bodies, links and joints have the names that the user has given them."""
    bodies = [(object_name(body.name), body.name) for body in scene.world.objects]
    own = [*scene.model.links_by_name, *scene.model.joints_by_name]
    return _renamed(" ".join(message.split()), [*bodies, *((engine_name(name), name) for name in own)])


def _renamed(message: str, names: Iterable[tuple[str, str]]) -> str:
    """What names a piece of something, such as "object/wall/0.3", names that."""
    known = dict(names)
    if not known:
        return message
    # A name may begin with another one.
    either = "|".join(map(re.escape, sorted(known, key=len, reverse=True)))
    return re.sub(rf"'?({either})(?:/\d+(?:\.\d+)?)?'?(?![\w/])", lambda found: f"'{known[found[1]]}'", message)
