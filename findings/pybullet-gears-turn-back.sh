#!/usr/bin/env bash
# PyBullet: a gear constraint of ratio 2 turns the second joint at minus one half
#
# Packages: pybullet 3.2.7, numpy 2.3.5
# Guess: gearRatio=2 makes the second joint turn at +2 times the speed of the first.
# Seen: The first joint turns at 1 rad/s, the second at -0.5 rad/s: sign and factor are the inverse.
# Matters to: models with coupled joints (grippers, differentials, mimic joints) that use this constraint.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet pybullet==3.2.7 numpy==2.3.5
cat > try.py <<'END'
import pybullet as p

INERTIAL = (
    '<inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>'
)
WHEEL = (
    '<link name="{0}">' + INERTIAL + '</link><joint name="j{0}" type="continuous"><parent link="base"/>'
    '<child link="{0}"/><origin xyz="{1} 0 0"/><axis xyz="0 0 1"/></joint>'
)
with open("two.urdf", "w") as file:
    file.write(f'<robot name="two"><link name="base">{INERTIAL}</link>{WHEEL.format("a", 0)}{WHEEL.format("b", 1)}</robot>')
p.connect(p.DIRECT)
robot = p.loadURDF("two.urdf", useFixedBase=True)
p.setJointMotorControl2(robot, 1, p.VELOCITY_CONTROL, force=0)
gear = p.createConstraint(robot, 0, robot, 1, p.JOINT_GEAR, [0, 0, 1], [0, 0, 0], [0, 0, 0])
p.changeConstraint(gear, gearRatio=2, maxForce=1000)
p.setJointMotorControl2(robot, 0, p.VELOCITY_CONTROL, targetVelocity=1, force=1000)
for _ in range(240):
    p.stepSimulation()
print("seen", *(f"{p.getJointState(robot, joint)[1]:.2f}" for joint in (0, 1)))
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen 1.00 -0.50'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
