"""The prefix that stands for the packages of Gazebo."""

from __future__ import annotations

from pathlib import Path

from sim_action.ros.ros2.environment_hooks import packages_of_prefix
from sim_action.ros.ros2.launch.stand_in_packages import write_prefix


def test_packages_are_indexed_and_their_launch_files_compile(tmp_path: Path) -> None:
    prefix = write_prefix(tmp_path / "gazebo")
    assert {"ros_gz_sim", "ros_gz_bridge", "gazebo_ros"} <= set(packages_of_prefix(prefix))
    files = {path.name: path.read_text() for path in prefix.rglob("*.launch.py")}
    assert {"gz_sim.launch.py", "gz_spawn_model.launch.py", "gzserver.launch.py"} <= set(files)
    for name, text in files.items():
        compile(text, name, "exec")
    assert "('gz', 'sim', '{gz_args}', '{ign_args}')" in files["gz_sim.launch.py"]
    assert 'startswith("{")' in files["gz_sim.launch.py"]
