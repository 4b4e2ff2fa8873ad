"""A workspace with two ROS packages, laid out as TurtleBot3's are, and what tests add to it.

repository/
  .git/
  simulation/drive.sim.yml
  src/rover_description/{package.xml, urdf/{rover.urdf.xacro, common_properties.xacro, wheel.xacro}, meshes/base.stl}
  src/rover_sensors/{package.xml, urdf/lidar.xacro, config/lidar.yaml, meshes/lidar.stl}
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from sim_action.core.workspace import Workspace
from sim_action.robot.documents.packages import Packages

NAMESPACE = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'

ROVER = f"""\
<?xml version="1.0" ?>
<robot name="rover" {NAMESPACE}>
  <xacro:arg name="mass" default="2.0"/>
  <xacro:arg name="with_lidar" default="true"/>
  <xacro:include filename="$(find rover_description)/urdf/common_properties.xacro"/>
  <xacro:include filename="wheel.xacro"/>
  <xacro:include filename="$(find rover_sensors)/urdf/lidar.xacro"/>

  <link name="base_link">
    <collision><geometry><mesh filename="package://rover_description/meshes/base.stl"/></geometry></collision>
    <inertial><mass value="$(arg mass)"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <xacro:wheel side="left" reflect="1"/>
  <xacro:wheel side="right" reflect="-1"/>
  <xacro:if value="$(arg with_lidar)">
    <xacro:lidar parent="base_link"/>
  </xacro:if>
</robot>
"""

PROPERTIES = f"""\
<?xml version="1.0" ?>
<robot {NAMESPACE}>
  <xacro:property name="wheel_radius" value="0.05"/>
  <xacro:property name="track" value="${{6 * wheel_radius}}"/>
  <material name="dark"><color rgba="0.1 0.1 0.1 1"/></material>
</robot>
"""

WHEEL = f"""\
<?xml version="1.0" ?>
<robot {NAMESPACE}>
  <xacro:macro name="wheel" params="side reflect">
    <link name="wheel_${{side}}_link">
      <collision><geometry><sphere radius="${{wheel_radius}}"/></geometry></collision>
    </link>
    <joint name="wheel_${{side}}_joint" type="continuous">
      <parent link="base_link"/>
      <child link="wheel_${{side}}_link"/>
      <origin xyz="0 ${{reflect * track / 2}} 0"/>
      <axis xyz="0 1 0"/>
    </joint>
  </xacro:macro>
</robot>
"""

LIDAR = f"""\
<?xml version="1.0" ?>
<robot {NAMESPACE}>
  <xacro:property name="lidar" value="${{xacro.load_yaml('$(find rover_sensors)/config/lidar.yaml')}}"/>
  <xacro:macro name="lidar" params="parent">
    <link name="lidar_link">
      <inertial><mass value="${{lidar.mass}}"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
      <collision><geometry><mesh filename="package://rover_sensors/meshes/lidar.stl"/></geometry></collision>
    </link>
    <joint name="lidar_joint" type="fixed"><parent link="${{parent}}"/><child link="lidar_link"/></joint>
  </xacro:macro>
</robot>
"""

TRIANGLE = """\
solid triangle
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 1 0
endloop
endfacet
endsolid triangle
"""


@dataclass(frozen=True)
class RosWorkspace:
    """Folders on the disk; `root` is the repository."""

    root: Path

    @property
    def description(self) -> Path:
        return self.root / "src/rover_description"

    @property
    def sensors(self) -> Path:
        return self.root / "src/rover_sensors"

    @property
    def rover(self) -> Path:
        """The model."""
        return self.description / "urdf/rover.urdf.xacro"

    def packages(
        self,
        mapped: Mapping[str, str] | None = None,
        environment: Mapping[str, str] | None = None,
        *,
        allow_outside: bool = False,
    ) -> Packages:
        """As the scenario simulation/drive.sim.yml has them, with no variable set but those given."""
        workspace = Workspace(self.root / "simulation", self.root, allow_outside)
        return Packages(workspace, mapped or {}, environment or {})

    def write(self, path: str, text: str) -> Path:
        return written(self.root / path, text)

    def robot(self, body: str, path: str = "src/rover_description/urdf/test.urdf.xacro") -> Path:
        """A xacro file with a <robot> around `body`, which begins on line 2."""
        return self.write(path, f'<robot name="test" {NAMESPACE}>\n{body}\n</robot>\n')


def ros_workspace(folder: Path) -> RosWorkspace:
    """Lays one out below a folder."""
    made = RosWorkspace(folder.resolve() / "repository")
    (made.root / ".git").mkdir(parents=True)
    made.write("simulation/drive.sim.yml", "name: drive\n")
    ros_package(made.description)
    ros_package(made.sensors)
    for path, text in {
        "rover_description/urdf/rover.urdf.xacro": ROVER,
        "rover_description/urdf/common_properties.xacro": PROPERTIES,
        "rover_description/urdf/wheel.xacro": WHEEL,
        "rover_description/meshes/base.stl": TRIANGLE,
        "rover_sensors/urdf/lidar.xacro": LIDAR,
        "rover_sensors/config/lidar.yaml": "mass: 0.25\n",
        "rover_sensors/meshes/lidar.stl": TRIANGLE,
    }.items():
        made.write(f"src/{path}", text)
    return made


def ros_package(folder: Path, name: str | None = None) -> Path:
    """A folder with a package.xml, which says `name`, or the folder's own."""
    manifest = f'<?xml version="1.0"?>\n<package format="3">\n  <name>{name or folder.name}</name>\n</package>\n'
    written(folder / "package.xml", manifest)
    return folder


def gazebo_model(folder: Path) -> Path:
    """A folder with a model.config and a model.sdf."""
    written(folder / "model.config", f"<model><name>{folder.name}</name><sdf>model.sdf</sdf></model>")
    written(folder / "model.sdf", f'<sdf version="1.6"><model name="{folder.name}"/></sdf>')
    return folder


def written(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path
