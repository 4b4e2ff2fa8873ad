"""Contacts of named links at every step, on every engine: where they are, how strong, and on which side."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from sim_action.assertions.upright import Upright
from sim_action.scenario.loading import build_scene
from sim_action.scenario.model import LoadedScenario
from sim_action.simulation.loop import SimulationRun, simulate
from sim_action.state.command import JointTargets
from sim_action.state.trace_records import Channels
from sim_action.state.trace_storage import load_trace, save_trace
from tests.integration.engines import on_every_engine, running
from tests.physics.robots import collision, inertial, joint, link, robot
from tests.scenarios import LEAST, load
from tests.traces import expectation

FEET = ("foot_1", "foot_2", "foot_3", "foot_4")
CORNERS = ((0.2, 0.15), (0.2, -0.15), (-0.2, 0.15), (-0.2, -0.15))
GRAVITY = 9.80665


def table(aside: float = 0.0) -> str:
    """A plate of 5 kg, whose centre of mass is `aside`, that stands on four balls of 200 g each."""
    plate = inertial(5.0, (0.1, 0.1, 0.1), (aside, 0.0, 0.0)) + collision('<box size="0.4 0.3 0.1"/>')
    ball = inertial(0.2, (1e-3, 1e-3, 1e-3)) + collision('<sphere radius="0.03"/>')
    parts = [link("plate", plate)]
    for name, (x, y) in zip(FEET, CORNERS, strict=True):
        parts += [link(name, ball), joint(f"to_{name}", "fixed", "plate", name, (x, y, -0.3))]
    return robot(*parts)


class Watching(Upright):
    """Reads the contacts of three feet."""

    key: ClassVar[str] = "upright"

    @property
    def channels(self) -> Channels:
        return Channels(link_contacts=frozenset(FEET[:3]))


def loaded_table(folder: Path, engine: str, rate: str = "240 Hz", objects: str = "[]") -> LoadedScenario:
    (folder / "table.urdf").write_text(table())
    text = LEAST.partition("commands:")[0].replace("turtlebot3_burger", "table.urdf")
    world = f"world: {{objects: {objects}}}\ntrace: {{rate: {rate}}}\nbackend: {engine}\n"
    return load(folder, f"{text}expect: [upright]\ntime_limit: 0.25 s\n{world}")


def run(folder: Path, engine: str, *, watching: bool = True, **keys: str) -> SimulationRun:
    loaded = loaded_table(folder, engine, **keys)
    watched = loaded.scenario.model_copy(update={"expect": (expectation(Watching()),)})
    return simulate(watched if watching else loaded.scenario, build_scene(loaded), lambda _: None)


@on_every_engine
def test_each_named_link_has_its_contacts_at_every_moment_from_the_start(engine: str, tmp_path: Path) -> None:
    trace = run(tmp_path, engine).trace
    assert list(trace.link_contacts) == list(FEET[:3])
    for (x, y), record in zip(CORNERS, trace.link_contacts.values(), strict=False):
        assert record.moment(trace.time).tolist() == list(range(61))
        assert record.bodies == ("ground",)
        assert record.position_xyz == pytest.approx(np.tile([x, y, 0.0], (61, 1)), abs=1e-3)
        assert record.normal_xyz == pytest.approx(np.tile([0.0, 0.0, 1.0], (61, 1)))
        assert record.force == pytest.approx(np.full(61, 5.8 * GRAVITY / 4), rel=0.05)


@on_every_engine
def test_the_normal_points_to_the_link_from_whatever_it_touches(engine: str, tmp_path: Path) -> None:
    # A platform below the first foot, as high as the ground, and a wall at the second.
    objects = "[{name: slab, box: [0.1, 0.1, 0.1], pose: {x: 0.2, y: 0.15, z: -0.05}}]"
    trace = run(tmp_path, engine, objects=objects).trace
    assert set(trace.link_contacts["foot_1"].bodies) == {"slab", "ground"}
    assert trace.link_contacts["foot_1"].normal_xyz[:, 2].min() > 0.999


@on_every_engine
def test_contacts_of_a_thinned_trace_are_those_of_its_moments(engine: str, tmp_path: Path) -> None:
    full, thinned = run(tmp_path, engine).trace, run(tmp_path, engine, rate="24 Hz").trace
    for name, record in thinned.link_contacts.items():
        assert record.moment(thinned.time).tolist() == list(range(len(thinned)))
        assert record.force.tolist() == full.link_contacts[name].force[::10].tolist()


@on_every_engine
def test_a_run_with_contacts_of_links_is_the_same_run_and_stored_whole(engine: str, tmp_path: Path) -> None:
    watching, plain = run(tmp_path, engine), run(tmp_path, engine, watching=False)
    assert watching.digest == plain.digest
    assert plain.trace.link_contacts == {}
    save_trace(watching.trace, tmp_path / "trace.npz")
    stored = load_trace(tmp_path / "trace.npz").link_contacts
    assert list(stored) == list(watching.trace.link_contacts)
    for name, record in watching.trace.link_contacts.items():
        assert stored[name].bodies == record.bodies
        for column in ("time", "body", "position_xyz", "normal_xyz", "force"):
            np.testing.assert_array_equal(getattr(stored[name], column), getattr(record, column))
    cut = replace(watching.trace, contacts=()).between(0.1, 0.2)
    assert cut.link_contacts["foot_1"].moment(cut.time).tolist() == list(range(25))


@on_every_engine
def test_normals_point_from_the_body_to_the_link(engine: str, tmp_path: Path) -> None:
    with running(engine, build_scene(loaded_table(tmp_path, engine))) as backend:
        backend.advance(0, [JointTargets()] * 24)
        contacts = backend.observe(24, contacts=True).contacts
        assert {contact.link for contact in contacts} == set(FEET)
        for contact in contacts:
            np.testing.assert_allclose(contact.normal_xyz, (0.0, 0.0, 1.0), atol=1e-3)
