#!/usr/bin/env bash
# pytransform3d stops a joint at its limit, urchin turns it on, and neither says so
#
# Packages: pytransform3d 3.17.0, urchin 0.0.30, numpy 2.3.5, scipy 1.17.1
# Guess: A joint set to 9 rad where the URDF allows 3 is an error in both.
# Seen: pytransform3d places the link at 3 rad and urchin at 9 rad (cosines -0.99 and -0.91), both without a
#   warning.
# Matters to: teams that compute where a tool is from logged joint values: two tools give two places.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet pytransform3d==3.17.0 urchin==0.0.30 numpy==2.3.5 scipy==1.17.1
cat > try.py <<'END'
import numpy as np
from pytransform3d.urdf import UrdfTransformManager
from urchin import URDF

ARM = """<robot name="arm">
  <link name="base"><inertial><mass value="5"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="bar"><inertial><origin xyz="0.5 0 0"/><mass value="2"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.2"/></inertial>
    <collision><origin xyz="0.5 0 0"/><geometry><box size="1 0.1 0.1"/></geometry></collision></link>
  <joint name="hinge" type="%s"><parent link="base"/><child link="bar"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="100" velocity="10"/></joint>
</robot>"""

with open("arm.urdf", "w") as file:
    file.write((ARM % "revolute").split("<collision>")[0] + (ARM % "revolute").split("</collision>")[1])
manager = UrdfTransformManager()
with open("arm.urdf") as file:
    manager.load_urdf(file.read())
manager.set_joint("hinge", 9)
robot = URDF.load("arm.urdf")
poses = robot.link_fk(cfg={"hinge": 9})
print(f"seen pytransform3d {manager.get_transform('bar', 'base')[0, 0]:.2f}", f"urchin {poses[robot.link_map['bar']][0, 0]:.2f}")
print(f"cosines of 3 and 9: {np.cos(3):.2f} {np.cos(9):.2f}")
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen pytransform3d -0.99 urchin -0.91'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
