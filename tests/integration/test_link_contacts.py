"""Contacts of named links at every step, on every engine: where they are, how strong, and on which side."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from sim_action.assertions.upright import Upright
from sim_action.scenario.loading import build_scene
from sim_action.simulation.loop import SimulationRun, simulate
from sim_action.state.command import JointTargets
from sim_action.state.trace_records import Channels
from sim_action.state.trace_storage import load_trace, save_trace
from tests.integration.engines import on_every_engine, running
from tests.scenarios import load
from tests.traces import expectation

FEET = ("foot_1", "foot_2", "foot_3", "foot_4")
CORNERS = ((0.2, 0.15), (0.2, -0.15), (-0.2, 0.15), (-0.2, -0.15))
GRAVITY = 9.80665


def table(mass: float = 5.0) -> str:
    """A plate of `mass` kg that stands on four balls of 200 g each."""
    feet = "".join(
        f"""<link name="{name}"><inertial><mass value="0.2"/>
        <inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>
        <collision><geometry><sphere radius="0.03"/></geometry></collision></link>
        <joint name="to_{name}" type="fixed"><parent link="plate"/><child link="{name}"/>
        <origin xyz="{x} {y} -0.3"/></joint>"""
        for name, (x, y) in zip(FEET, CORNERS, strict=True)
    )
    return f"""<robot name="table"><link name="plate"><inertial><mass value="{mass}"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="0.4 0.3 0.1"/></geometry></collision></link>{feet}</robot>"""


class Watching(Upright):
    """Reads the contacts of three feet."""

    key: ClassVar[str] = "upright"

    @property
    def channels(self) -> Channels:
        return Channels(link_contacts=frozenset(FEET[:3]))


def run(
    tmp_path: Path, engine: str, *, rate: str = "240 Hz", objects: str = "[]", watching: bool = True
) -> SimulationRun:
    (tmp_path / "table.urdf").write_text(table())
    text = f"""\
name: a table stands
robot: {{model: table.urdf}}
world: {{objects: {objects}}}
expect: [upright]
time_limit: 0.25 s
trace: {{rate: {rate}}}
backend: {engine}
"""
    loaded = load(tmp_path, text)
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
    for link, record in thinned.link_contacts.items():
        assert record.moment(thinned.time).tolist() == list(range(len(thinned)))
        assert record.force.tolist() == full.link_contacts[link].force[::10].tolist()


@on_every_engine
def test_a_run_with_contacts_of_links_is_the_same_run_and_stored_whole(engine: str, tmp_path: Path) -> None:
    watching, plain = run(tmp_path, engine), run(tmp_path, engine, watching=False)
    assert watching.digest == plain.digest
    assert plain.trace.link_contacts == {}
    save_trace(watching.trace, tmp_path / "trace.npz")
    found = load_trace(tmp_path / "trace.npz").link_contacts
    assert list(found) == list(watching.trace.link_contacts)
    for link, record in watching.trace.link_contacts.items():
        assert found[link].bodies == record.bodies
        for column in ("time", "body", "position_xyz", "normal_xyz", "force"):
            np.testing.assert_array_equal(getattr(found[link], column), getattr(record, column))
    cut = replace(watching.trace, contacts=()).between(0.1, 0.2)
    assert cut.link_contacts["foot_1"].moment(cut.time).tolist() == list(range(25))


@on_every_engine
def test_normals_point_from_the_body_to_the_link(engine: str, tmp_path: Path) -> None:
    (tmp_path / "table.urdf").write_text(table())
    text = "robot: {model: table.urdf}\nworld: {objects: []}\nexpect: [upright]\ntime_limit: 0.25 s\n"
    loaded = load(tmp_path, f"name: a table stands\n{text}backend: {engine}\n")
    with running(engine, build_scene(loaded)) as backend:
        backend.advance(0, [JointTargets()] * 24)
        contacts = backend.observe(24, contacts=True).contacts
        assert {contact.link for contact in contacts} == set(FEET)
        for contact in contacts:
            np.testing.assert_allclose(contact.normal_xyz, (0.0, 0.0, 1.0), atol=1e-3)
