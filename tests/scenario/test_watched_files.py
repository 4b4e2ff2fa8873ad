"""Which files a scenario file is made of."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sim_action.core.permissions import Permissions
from sim_action.scenario import watched_files as module
from sim_action.scenario.files import read_file
from sim_action.scenario.source import Source
from sim_action.scenario.watched_files import NamedFiles, stamps, watched_files

URDF = '<robot name="r"><link name="a"><visual><geometry><mesh filename="{}"/></geometry></visual></link></robot>'


@pytest.fixture(autouse=True)
def workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The root of a repository."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / ".git").mkdir()
    return tmp_path


def write(name: str, text: str = "") -> Path:
    path = Path(name)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def found(scenario: str, name: str = "sim/a.sim.yml", *, allow_outside: bool = False) -> list[str]:
    """What is watched of a scenario, seen from the workspace."""
    paths = watched_files(write(name, scenario), Permissions(outside=allow_outside))
    return sorted(Path(os.path.relpath(path)).as_posix() for path in paths)


def test_a_scenario_without_files_is_its_own_file() -> None:
    assert found("robot: {model: turtlebot3_burger}\ncommands: {twist: [{linear: 1.0, for: 2 s}]}") == ["sim/a.sim.yml"]


def test_names_are_seen_from_the_file_that_they_stand_in() -> None:
    write("sim/bases/b.base.yml", "extends: ../../c.base.yml\ncommands: {replay: log.csv}")
    write("sim/bases/log.csv")
    write("c.base.yml", "world: {objects: [{name: a, mesh: {file: sim/rock.obj}}]}")
    write("sim/rock.obj", "mtllib rock.mtl\nv 0 0 0\n")
    write("sim/rock.mtl")
    watched = found("extends: bases/b.base.yml")
    assert watched == [
        *("c.base.yml", "sim/a.sim.yml", "sim/bases/b.base.yml", "sim/bases/log.csv", "sim/rock.mtl", "sim/rock.obj")
    ]
    # Files of a loaded scenario are those that are watched.
    write("sim/robots/r.urdf", URDF.format("m.stl"))
    write("sim/robots/m.stl")
    text = "name: a\nextends: bases/b.base.yml\nrobot: {model: robots/r.urdf}"
    assert named(text) == [found(text)]


@pytest.mark.parametrize(
    "ros1",
    [
        "{launch: [driver, drive.launch]}",
        "{nodes: [driver/mover.py]}",
        "{nodes: [{package: driver, type: mover.py}, {package: 3}, 4, nobody/a.py]}",
    ],
)
def test_packages_of_nodes_are_watched(ros1: str) -> None:
    of_package = [f"ws/src/driver/{name}" for name in ("launch/drive.launch", "mover.py", "package.xml")]
    for name in of_package:
        write(name, "<package><name>driver</name></package>")
    assert set(of_package) <= set(found(f"commands: {{ros1: {ros1}}}"))
    assert set(of_package) <= set(found(f"commands: [{{ros1: {ros1}}}]"))


@pytest.mark.parametrize(
    "ros2",
    [
        "{launch: [driver, drive.launch.py]}",
        "{nodes: [driver/mover]}",
        "{nodes: [{package: driver, executable: mover}, {package: 3}, 4, nobody/a]}",
    ],
)
def test_packages_of_nodes_of_ros_2_are_watched(ros2: str) -> None:
    of_package = [
        f"ws/src/driver/{name}"
        for name in (
            *("launch/drive.launch.py", "launch/arm.launch.xml", "driver/mover.py", "src/mover.cpp", "scripts/mover"),
            *("package.xml", "setup.cfg", "config/a.yml"),
        )
    ]
    for name in of_package:
        write(name, "<package><name>driver</name></package>" if name.endswith("package.xml") else "")
    write("ws/src/driver/scripts/mover.pyc")
    for commands in (f"{{ros2: {ros2}}}", f"[{{ros2: {ros2}}}]"):
        listed = found(f"commands: {commands}")
        assert set(of_package) <= set(listed)
        assert not any(name.endswith(".pyc") for name in listed)


def test_built_packages_of_ros_2_are_watched() -> None:
    built = ["ws/install/driver/lib/driver/mover", "ws/install/driver/share/driver/package.xml"]
    for name in built:
        write(name, "<package><name>driver</name></package>")
    write("ws/install/.colcon_install_layout", "isolated")
    assert set(built) <= set(found("commands: {ros2: {nodes: [driver/mover], workspace: ../ws}}"))


@pytest.mark.parametrize("key", ["ros1", "ros2"])
@pytest.mark.parametrize("spec", ["3", "{}", "{launch: 3}", "{nodes: 3}", "{launch: []}"])
def test_what_is_no_list_of_nodes_is_no_file(key: str, spec: str) -> None:
    assert found(f"commands: {{{key}: {spec}}}") == ["sim/a.sim.yml"]


def test_nodes_and_launch_files_in_files_are_watched() -> None:
    write("sim/mover.py")
    write("sim/steering.py")
    write("sim/drive.launch.py")
    listed = found("commands: {ros2: {nodes: [./mover.py, {file: ./mover.py}]}}")
    assert {"sim/mover.py", "sim/steering.py"} <= set(listed)
    assert "sim/drive.launch.py" in found("commands: {ros2: {launch: [./drive.launch.py, 'x:=1']}}")


def test_a_script_is_watched_with_what_it_may_import() -> None:
    write("sim/controller.py")
    write("sim/steering.py")
    write("sim/deep/other.py")
    expected = ["sim/a.sim.yml", "sim/controller.py", "sim/steering.py"]
    assert found("commands: {script: controller.py}") == expected
    assert found("commands: {process: python3 controller.py --fast}") == expected
    assert found("expect: [{assertion: {class: 'controller.py:Judge'}}]") == expected


def test_models_are_watched_with_their_meshes_and_what_they_include() -> None:
    write("robots/package.xml", "<package><name>robots</name></package>")
    write("robots/urdf/r.urdf.xacro", '<robot><xacro:include filename="$(find robots)/urdf/wheel.xacro"/></robot>')
    write("robots/urdf/wheel.xacro", URDF.format("package://robots/meshes/wheel.stl"))
    write("robots/meshes/wheel.stl")
    watched = found("robot: {model: ../robots/urdf/r.urdf.xacro}")
    assert watched == [
        *("robots/meshes/wheel.stl", "robots/urdf/r.urdf.xacro", "robots/urdf/wheel.xacro", "sim/a.sim.yml")
    ]
    assert found("robot: {model: 'package://robots/urdf/wheel.xacro'}")[0] == "robots/meshes/wheel.stl"


def test_parameter_files_of_plugins_are_watched() -> None:
    write("robots/package.xml", "<package><name>robots</name></package>")
    tags = "<parameters>$(find robots)/config/a.yaml</parameters><parameters>../config/b.yaml</parameters>"
    write("robots/urdf/r.urdf", f"<robot><gazebo><plugin>{tags}</plugin></gazebo></robot>")
    write("robots/config/a.yaml", "a: 1")
    write("robots/config/b.yaml", "b: 1")
    watched = found("robot: {model: ../robots/urdf/r.urdf}")
    assert watched == ["robots/config/a.yaml", "robots/config/b.yaml", "robots/urdf/r.urdf", "sim/a.sim.yml"]


def test_a_gazebo_model_is_watched_by_its_folder() -> None:
    write("models/cart/model.config", "<model><sdf version='1.6'>model.sdf</sdf></model>")
    write("models/cart/model.sdf", "<sdf><model><mesh><uri>meshes/cart.obj</uri></mesh></model></sdf>")
    write("models/cart/meshes/cart.obj")
    watched = found("robot: {model: ../models/cart}")
    assert {"models/cart/meshes/cart.obj", "models/cart/model.config", "models/cart/model.sdf"} <= set(watched)
    # A file that is missing is waited for.
    assert "sim/later.urdf" in found("robot: {model: later.urdf}")


@pytest.mark.parametrize("text", ["a: [", "", "- 1", "a: 'x/\\0'", "extends: a.sim.yml", "robot: {packages: {a: 1}}"])
def test_what_is_no_scenario_yet_is_watched_by_itself(text: str) -> None:
    assert found(text) == ["sim/a.sim.yml"]


def test_nothing_outside_of_the_workspace_is_looked_at_unless_it_may_be(tmp_path: Path) -> None:
    inner = tmp_path / "inner"
    (inner / ".git").mkdir(parents=True)
    write("outside.csv")
    scenario = f"commands: [{{replay: ../outside.csv}}, {{replay: {tmp_path / 'outside.csv'}}}]"
    write("linked.urdf")
    (inner / "link.urdf").symlink_to(tmp_path / "linked.urdf")
    scenario += "\nrobot: {model: link.urdf}\nexpect: [{follow_path: {file: ../missing.csv}}]"
    assert watched_files(write("inner/a.sim.yml", scenario)) == {inner / "a.sim.yml"}
    assert "outside.csv" in found(scenario, "inner/a.sim.yml", allow_outside=True)


@pytest.mark.parametrize(
    "tag",
    [
        '<xacro:include filename="$(find p)/../../outside/secret.xml"/>',
        '<xacro:include filename="$(find p)/../.git/c.yaml"/>',
        "<parameters>$(find p)/../../outside/secret.yaml</parameters>",
        "<parameters>$(find p)/../.GIT/c.yaml</parameters>",
    ],
)
def test_no_reference_of_a_model_leads_outside_the_workspace(tag: str, tmp_path: Path) -> None:
    write("outside/secret.xml")
    write("outside/secret.yaml")
    (tmp_path / "inner/.git").mkdir(parents=True)
    write("inner/.git/c.yaml")
    write("inner/p/package.xml", "<package><name>p</name></package>")
    write("inner/p/r.urdf", f"<robot>{tag}</robot>")
    expected = ["inner/a.sim.yml", "inner/p/r.urdf"]
    assert found("name: a\nrobot: {model: p/r.urdf}", "inner/a.sim.yml") == expected
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path / "inner")
        assert named("name: a\nrobot: {model: ../p/r.urdf}") == [["p/r.urdf", "sim/a.sim.yml"]]


def test_links_in_a_model_folder_lead_not_outside_the_workspace(tmp_path: Path) -> None:
    write("outside/secret.sdf")
    (tmp_path / "inner/.git").mkdir(parents=True)
    write("inner/m/model.sdf")
    (tmp_path / "inner/m/x.sdf").symlink_to(tmp_path / "outside/secret.sdf")
    (tmp_path / "inner/m/y.config").symlink_to(tmp_path / "outside/secret.sdf")
    (tmp_path / "inner/m/z.config").symlink_to("z.config")
    assert found("robot: {model: ./m}", "inner/a.sim.yml") == ["inner/a.sim.yml", "inner/m/model.sdf"]


def test_there_is_a_most(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_FILES", 5)
    scenario = f"variations: {{robot.model: [{', '.join(f'{number}.urdf' for number in range(20))}]}}"
    assert len(found(scenario)) == 5


@settings(suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
@given(st.text(max_size=80))
def test_no_name_is_too_odd(text: str) -> None:
    assert "sim/a.sim.yml" in found(f"robot: {{model: {json.dumps(text)}}}")


def test_stamps_tell_a_file_that_was_written_or_replaced_or_is_gone(tmp_path: Path) -> None:
    path = write("a", "1")
    first = stamps([path])
    assert stamps([path]) == first
    path.write_text("12")
    second = stamps([path])
    assert second != first
    write("b", "12").replace(path)
    assert stamps([path]) != second
    path.unlink()
    assert stamps([path, Path("x\0")]) == {path: None, Path("x\0"): None}


def test_meshes_of_mjcf_lie_in_its_folder_of_meshes() -> None:
    write("sim/arm.xml", '<mujoco><compiler meshdir="../meshes"/><include file="parts.xml"/></mujoco>')
    write("sim/parts.xml", '<mujoco><asset><mesh file="hand.stl"/></asset></mujoco>')
    write("meshes/hand.stl")
    assert set(found("robot: {model: arm.xml}")) == {"sim/a.sim.yml", "sim/arm.xml", "sim/parts.xml", "meshes/hand.stl"}


def named(text: str) -> list[list[str]]:
    """The files that each run of a scenario names, seen from the workspace."""
    files = NamedFiles()
    sources = read_file(write("sim/a.sim.yml", text), Permissions())
    paths = [files.of(source) for source in sources if isinstance(source, Source)]
    return [sorted(Path(os.path.relpath(path)).as_posix() for path in of_run) for of_run in paths]


def test_each_variation_names_files_of_its_own() -> None:
    write("sim/golden/v=1.csv")
    text = "name: a\nexpect: [{matches: {trace: golden/$variation.csv}}]\nvariations: {seed: [1, 2]}"
    of_runs = named(text)
    assert len(of_runs) == 2
    assert of_runs[0] != of_runs[1]
    assert all("sim/a.sim.yml" in of_run and len(of_run) == 2 for of_run in of_runs)


def test_tables_of_samples_are_watched_and_named_by_all_runs() -> None:
    write("sim/rows.csv", "x,y\n1,2\n3,4\n")
    text = "name: a\nextends: bases/b.base.yml\nvariations: {robot.pose.x: {csv: rows.csv}}\n"
    write("sim/bases/b.base.yml", "time_limit: 9\nvariations: {robot.pose.y: {csv: ../rows.csv}}")
    files = ["sim/a.sim.yml", "sim/bases/b.base.yml", "sim/rows.csv"]
    assert found(text) == files
    assert named(text) == [files, files]
