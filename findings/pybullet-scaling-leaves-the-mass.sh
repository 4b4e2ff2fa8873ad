#!/usr/bin/env bash
# PyBullet: globalScaling moves the centre of mass and leaves mass and inertia
#
# Packages: pybullet 3.2.7, numpy 2.3.5
# Guess: A body of twice the size has eight times the mass, or at least 4 times the inertia for the same mass.
# Seen: With globalScaling=2 the centre of mass moves from 0.5 m to 1.0 m; the mass stays 2 kg and the principal
#   inertia 0.2 kg m^2.
# Matters to: everybody who scales a model: levers are twice as long, and the links turn as easily as before.
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
for scale in (1, 2):
    arm = p.loadURDF("arm.urdf", globalScaling=scale, flags=p.URDF_USE_INERTIA_FROM_FILE)
    mass, _, inertia, centre, *_ = p.getDynamicsInfo(arm, 0)
    print(f"seen scale {scale}: mass {mass:g} inertia {inertia[1]:g} centre {centre[0]:g}")
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen scale 1: mass 2 inertia 0.2 centre 0.5
seen scale 2: mass 2 inertia 0.2 centre 1'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
