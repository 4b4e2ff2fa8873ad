#!/usr/bin/env bash
# PyBullet: the force sensor of a joint gives the moment about the centre of mass of the child
#
# Packages: pybullet 3.2.7, numpy 2.3.5
# Guess: The sensor sits in the joint: a bar of 2 kg whose centre of mass is 0.5 m away gives 19.62 N and 9.81 N m.
# Seen: It gives 19.62 N and a moment of 0 N m: the moment is taken about the centre of mass of the link below.
# Matters to: force and torque sensors at wrists: the lever of the tool is missing from the reading.
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
    file.write(ARM % "fixed")
p.connect(p.DIRECT)
p.setGravity(0, 0, -9.81)
arm = p.loadURDF("arm.urdf", useFixedBase=True)
p.enableJointForceTorqueSensor(arm, 0)
for _ in range(10):
    p.stepSimulation()
wrench = p.getJointState(arm, 0)[2]
moment = sum(value * value for value in wrench[3:]) ** 0.5
print(f"seen force {wrench[2]:.2f} moment {moment:.2f}")
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen force 19.62 moment 0.00'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
