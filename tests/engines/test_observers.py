"""Contacts are read when somebody looks, or has not let go of them when the engine goes on."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace

from hypothesis import given
from hypothesis import strategies as st

from sim_action.engines.observers import MIN_OVERLAP_M, LazyContacts, Nearest, PathContacts, path_contacts
from sim_action.state.observation import Contact
from sim_action.world import Body, PathPoint, World, path_of
from sim_action.world.scene import Scene
from sim_action.world.shapes import Sphere
from tests.soak import examples
from tests.traces import burger, scene


class Engine:
    """Counts how often its contacts are read; a contact tells the moment at which it was."""

    def __init__(self) -> None:
        self.moment = 0.0
        self.read = 0

    def contacts(self) -> Iterator[Contact]:
        self.read += 1
        yield Contact(self.moment, "link", "wall", (0.0, 0.0, 0.0), 1.0)


def test_contacts_are_read_once_if_they_are_looked_at_and_else_not_at_all() -> None:
    engine, lazy = Engine(), LazyContacts()
    lazy.present(engine.contacts)
    lazy.settle()
    assert engine.read == 0
    looked_at = lazy.present(engine.contacts)
    assert [len(looked_at), looked_at[0].time, next(iter(looked_at)).link] == [1, 0.0, "link"]
    lazy.settle()
    assert engine.read == 1


def test_a_second_look_at_the_same_moment_leaves_the_first_what_it_is() -> None:
    engine, lazy = Engine(), LazyContacts()
    first, second = lazy.present(engine.contacts), lazy.present(engine.contacts)
    lazy.settle()
    engine.moment = 1.0
    assert first == second
    assert first[0].time == 0.0


RATE = 240
BASE = "base_footprint"
RADIUS = 0.5


def body(*points: tuple[float, float], loop: bool = False, name: str = "agv") -> Body:
    """A ball of 0.5 m on a path of (s, m) along x."""
    path = tuple(PathPoint(at=at, x=x) for at, x in points)
    return Body(name=name, sphere=Sphere(radius=RADIUS), path=path, loop=loop)


def bolted(*bodies: Body) -> Scene:
    made = scene(burger())
    return replace(made, robot=made.robot.model_copy(update={"base": "fixed"}), world=World(objects=bodies))


@dataclass
class Space:
    """An engine in which every link is a point at the origin; it counts what it is asked."""

    where: Scene
    step: int = 0
    asked: list[int] = field(default_factory=list)

    def distance(self, body: Body, step: int) -> float:
        path = path_of(body, self.where.parts_of(body))
        return abs(path.pose(max(step, 0) / RATE).position_xyz[0]) - RADIUS

    def nearest(self, name: str, links: Collection[str]) -> dict[str, Nearest]:
        self.asked.append(self.step)
        (body,) = (body for body in self.where.world.objects if body.name == name)
        return {link: Nearest(self.distance(body, self.step), (0.0, 0.0, 0.0)) for link in links}


def watched(space: Space) -> PathContacts:
    made = path_contacts(space.where, [BASE], space.nearest)
    assert made is not None
    return made


def seen(space: Space, steps: Sequence[int]) -> list[Contact]:
    contacts, found = watched(space), list[Contact]()
    for step in steps:
        space.step = step
        found += contacts.at(step)
    return found


times = st.lists(st.floats(0.05, 2.0), min_size=1, max_size=5)
places = st.lists(st.floats(-3, 3), min_size=6, max_size=6)


@examples(20)
@given(times, places, st.booleans(), st.floats(0, 1))
def test_every_overlap_is_seen_at_its_step(gaps: list[float], xs: list[float], loop: bool, begins: float) -> None:
    points, at = [(begins, xs[0])], begins
    for gap, x in zip(gaps, xs[1:], strict=False):
        at += gap
        points.append((at, x))
    if loop:
        points.append((at + 0.5, xs[0]))
    space = Space(bolted(body(*points, loop=loop)))
    steps = range(1, 1500)
    found = [contact.time for contact in seen(space, steps)]
    (agv,) = space.where.world.objects
    assert found == [step / RATE for step in steps if space.distance(agv, step) < -MIN_OVERLAP_M]


def test_a_contact_without_a_force_names_the_pair() -> None:
    found = seen(Space(bolted(body((0, 2), (2, 0)))), [480])
    assert found == [Contact(2.0, BASE, "agv", (0.0, 0.0, 0.0), 0.0, has_force=False, depth=0.5)]


def test_a_body_that_is_far_away_is_seldom_measured() -> None:
    space = Space(bolted(body((0, 3), (5, 1), (10, 3))))
    assert seen(space, range(1, 2400)) == []
    assert len(space.asked) < 20


def test_a_body_at_rest_is_measured_once_at_most() -> None:
    space = Space(bolted(body((0, 3), (1, 0.55))))
    seen(space, range(1, 2400))
    assert len([step for step in space.asked if step > 240]) <= 1


def test_the_same_moment_can_be_asked_for_again() -> None:
    space = Space(bolted(body((0, 0), (2, 2))))
    contacts = watched(space)
    # Before t = 0 the body waits at its start.
    assert [len(contacts.at(step)) for step in (0, -5, -4, 0, 0)] == [1] * 5
    space.step = 10
    assert contacts.at(10) == contacts.at(10) != ()


def test_each_body_touches_in_its_own_time() -> None:
    space = Space(bolted(body((0, 2), (1, 0), (2, 2)), body((1, -2), (2, 0), (3, -2), name="other")))
    found = seen(space, range(1, 720))
    assert {contact.body for contact in found if contact.time < 1.4} == {"agv"}
    assert {contact.body for contact in found if contact.time > 1.6} == {"other"}


def test_only_links_that_cannot_move_count() -> None:
    free, still = scene(burger()), Body(name="wall", sphere=Sphere(radius=1.0))
    agv = body((0, 2), (1, 0))
    space = Space(bolted(agv))
    assert path_contacts(replace(free, world=World(objects=(agv,))), [BASE], space.nearest) is None
    assert path_contacts(bolted(still), [BASE], space.nearest) is None
    assert path_contacts(bolted(agv), ["wheel_left_link"], space.nearest) is None
