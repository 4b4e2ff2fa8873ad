#!/usr/bin/env bash
# PyBullet: changeDynamics(mass=) replaces the inertia of the file by that of the collision shape
#
# Packages: pybullet 3.2.7, numpy 2.3.5
# Guess: A new mass leaves the inertia of the file, or scales it by the same factor.
# Seen: A bar of 2 kg with inertias 0.01, 0.2, 0.2 that is set to 2 kg again (no change) gets those of its collision
#   box: 0.003, 0.168, 0.168. The flag URDF_USE_INERTIA_FROM_FILE does not prevent it.
# Matters to: tests of payloads and of uncertain masses: the inertia moves although nobody touched it.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet pybullet==3.2.7 numpy==2.3.5
cat > try.py <<'END'
import pybullet as p

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
    file.write(ARM % "revolute")
p.connect(p.DIRECT)
arm = p.loadURDF("arm.urdf", flags=p.URDF_USE_INERTIA_FROM_FILE)
before = p.getDynamicsInfo(arm, 0)[2]
p.changeDynamics(arm, 0, mass=2)
after = p.getDynamicsInfo(arm, 0)[2]
for name, inertia in (("before", before), ("after", after)):
    print(f"seen {name}", *(f"{value:.3f}" for value in inertia))
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen before 0.010 0.200 0.200
seen after 0.003 0.168 0.168'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
