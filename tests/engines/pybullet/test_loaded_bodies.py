"""Bodies as PyBullet gets them. A connection that is used again is as good as a new one, and others stay."""

from __future__ import annotations

import errno
import math
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core import geometry
from sim_action.core.errors import EngineError
from sim_action.engines import ENGINES
from sim_action.scenario.loading import build_scene
from sim_action.world.scene import Scene
from tests.mesh_files import CORNERS, moved, stl
from tests.scenarios import load
from tests.simulated import simulated

pytestmark = pytest.mark.pybullet
angles = st.floats(-math.pi, math.pi)
AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@given(angles, angles, angles)
def test_the_quaternion_of_a_matrix_turns_as_the_matrix(roll: float, pitch: float, yaw: float) -> None:
    from sim_action.engines.pybullet.loaded_bodies import _turned

    rotation = geometry.quaternion_from_rpy(roll, pitch, yaw)
    columns = [geometry.rotate(rotation, axis) for axis in AXES]
    found = _turned(np.array(columns).T)
    assert math.hypot(*found) == pytest.approx(1.0)
    assert [geometry.rotate(found, axis) for axis in AXES] == [pytest.approx(column, abs=1e-9) for column in columns]


BOX = """\
<robot name="box">
  <link name="base">
    <inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <collision><geometry><mesh filename="box.stl"/></geometry></collision>
  </link>
</robot>
"""


def boxed(folder: Path, urdf: str) -> Scene:
    (folder / "box.urdf").write_text(urdf)
    (folder / "box.stl").write_bytes(stl())
    return build_scene(load(folder, "name: a\nrobot: {model: box.urdf}\nexpect: [upright]\ntime_limit: 1 s\n"))


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    return boxed(tmp_path, BOX)


BURGER = """\
name: a
robot: {model: turtlebot3_burger}
world:
  objects:
    - {name: ball, sphere: {radius: 0.1}, mass: 2 kg, pose: {x: 2}}
    - {name: dumbbell, mass: 2 kg, pose: {x: 3}, shapes: [{sphere: {radius: 0.1}}, {box: [0.1, 0.1, 0.3]}]}
expect: [upright]
time_limit: 1 s
"""


def test_no_body_costs_more_than_a_box_to_draw(tmp_path: Path) -> None:
    import pybullet

    from sim_action.engines.pybullet.engine import PyBulletEngine

    engine = PyBulletEngine(build_scene(load(tmp_path, BURGER)))
    bodies = range(pybullet.getNumBodies(engine._client))
    drawn = [shape for body in bodies for shape in pybullet.getVisualShapeData(body, physicsClientId=engine._client)]
    # The ground, two objects, and five links of the robot.
    assert [shape[2] for shape in drawn] == [pybullet.GEOM_BOX] * 8
    engine.close()


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has files in memory")
def test_a_robot_without_meshes_needs_no_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = build_scene(load(tmp_path, BURGER.replace("    - {name: dumbbell", "    # {")))
    monkeypatch.setattr(tempfile, "TemporaryDirectory", lambda **_: pytest.fail("a folder was made"))
    ENGINES["pybullet"].load()(scene).close()


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has files in memory")
def test_a_robot_is_read_from_a_folder_without_memory_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(_: str) -> int:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))

    monkeypatch.setattr(os, "memfd_create", refused)
    engine = ENGINES["pybullet"].load()(build_scene(load(tmp_path, BURGER)))
    assert set(engine.observe(0, contacts=False).joints) == {"wheel_left_joint", "wheel_right_joint"}
    engine.close()


MORE = '<collision><origin xyz="1 0 0"/><geometry>{}</geometry></collision>'


@pytest.mark.parametrize(
    "shapes", [('<mesh filename="box.stl"/>',), ('<mesh filename="other.stl"/>', '<box size="1 1 1"/>')], ids=str
)
@pytest.mark.parametrize("first", [True, False])
def test_a_link_may_have_several_meshes(first: bool, shapes: tuple[str, ...], tmp_path: Path) -> None:
    more, mark = "".join(map(MORE.format, shapes)), "<collision>" if first else "</link>"
    (tmp_path / "other.stl").write_bytes(stl(moved(CORNERS, 2)))
    engine = ENGINES["pybullet"].load()(boxed(tmp_path, BOX.replace(mark, more + mark, 1)))
    assert engine.observe(0, contacts=False).pose.position_xyz[2] > 0.29
    engine.close()


def test_a_model_is_not_read_without_open_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    more = MORE.format('<mesh filename="box.stl"/>')
    scene = boxed(tmp_path, BOX.replace("</link>", f"{more}</link>"))
    left, opened = [3], Path.open

    def limited(path: Path, *options: Any, **named: Any) -> Any:
        left[0] -= 1
        if left[0] <= 0:
            raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))
        return opened(path, *options, **named)

    monkeypatch.setattr(Path, "open", limited)
    with pytest.raises(EngineError, match="too many open files"):
        ENGINES["pybullet"].load()(scene)


def without_mesh(load: Callable[..., int], times: int) -> Callable[..., int]:
    """PyBullet's loader, where the mesh cannot be read the first few times."""
    left = [times]

    def loaded(path: str, **options: Any) -> int:
        if not left[0]:
            return load(path, **options)
        left[0] -= 1
        # PyBullet finds the file, and reads nothing, as when its second attempt to open it fails.
        (mesh,) = Path(path).parent.glob("*.obj")
        text = mesh.read_bytes()
        mesh.write_bytes(b"")
        try:
            return load(path, **options)
        finally:
            mesh.write_bytes(text)

    return loaded


def test_a_mesh_that_cannot_be_read_for_a_moment_is_not_left_out(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    import pybullet

    monkeypatch.setattr(pybullet, "loadURDF", without_mesh(pybullet.loadURDF, 1))
    engine = ENGINES["pybullet"].load()(scene)
    assert engine.observe(0, contacts=False).pose.position_xyz[2] == pytest.approx(0.3, abs=1e-3)
    engine.close()
    # A robot without one of its meshes is refused.
    monkeypatch.setattr(pybullet, "loadURDF", without_mesh(pybullet.loadURDF, 2))
    with pytest.raises(EngineError, match="PyBullet made 0 of 1 collision shapes of the robot"):
        ENGINES["pybullet"].load()(scene)


DRIVES = """\
name: drives
robot: {model: turtlebot3_burger}
commands: {rate: 10 Hz, twist: [{linear: 0.5, angular: 0.3}]}
expect: [upright]
duration: 0.5 s
time_limit: 1 s
backend: pybullet
"""
# Other gravity, friction and rate, a solver that uses all its iterations, and a body that lies on another one.
DIFFERS = """\
name: differs
robot: {model: turtlebot3_burger, pose: {y: 2, yaw: 90 deg}}
physics: {rate: 500 Hz}
world:
  gravity: 3 m/s^2
  ground: {friction: 0.3}
  objects:
    - {name: table, box: [1, 1, 0.5], pose: {x: 2}}
    - {name: ball, sphere: {radius: 0.1}, mass: 2 kg, pose: {x: 2, z: 0.8}}
expect: [upright]
duration: 0.2 s
time_limit: 1 s
backend: pybullet
"""


@pytest.fixture
def new_connections() -> Iterator[None]:
    forget()
    yield
    forget()


def forget() -> None:
    import pybullet

    from sim_action.engines.pybullet import loaded_bodies

    for client in (*loaded_bodies._RELEASED, *(each.client for each in loaded_bodies._AHEAD)):
        pybullet.disconnect(client)
    loaded_bodies._RELEASED.clear()
    loaded_bodies._AHEAD.clear()


@pytest.mark.usefixtures("new_connections")
def test_a_run_in_a_connection_that_was_used_has_the_digest_of_a_new_one(tmp_path: Path) -> None:
    first, *again = (simulated(tmp_path, text).digest for text in (DRIVES, DIFFERS, DRIVES, DIFFERS, DRIVES))
    forget()
    assert again == [simulated(tmp_path, DIFFERS).digest, first] * 2


@pytest.mark.usefixtures("new_connections")
def test_released_connections_are_used_again_and_closed_ones_replaced() -> None:
    import pybullet

    from sim_action.engines.pybullet.loaded_bodies import connected, release

    one, two = connected(), connected()
    pybullet.createMultiBody(1, physicsClientId=one.client)
    pybullet.createMultiBody(1, physicsClientId=two.client)
    release(two.client)
    again = connected()
    assert again == two
    assert [pybullet.getNumBodies(each.client) for each in (one, again)] == [2, 1]
    release(again.client)
    release(one.client)
    assert pybullet.isConnected(again.client)
    assert not pybullet.isConnected(one.client)
    # One that others have closed is replaced.
    first = connected()
    release(first.client)
    pybullet.disconnect(first.client)
    second = connected()
    assert pybullet.getNumBodies(second.client) == 1
    release(second.client)
