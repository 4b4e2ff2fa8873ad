#!/usr/bin/env bash
# PyBullet: restoreState does not restore the targets of motors
#
# Packages: pybullet 3.2.7, numpy 2.3.5
# Guess: saveState keeps what decides the next step, so a restored run goes on as the saved one did.
# Seen: The joint comes back with its saved speed (1 rad/s), and one step later it has the speed that was commanded
#   after the save (5 rad/s).
# Matters to: learning and search code that branches from a saved state, and tests that compare two branches.
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
arm = p.loadURDF("arm.urdf", useFixedBase=True)


def drive(speed, steps=20):
    p.setJointMotorControl2(arm, 0, p.VELOCITY_CONTROL, targetVelocity=speed, force=1000)
    for _ in range(steps):
        p.stepSimulation()


drive(1)
state = p.saveState()
drive(5)
p.restoreState(state)
restored = p.getJointState(arm, 0)[1]
p.stepSimulation()
print(f"seen restored {restored:.2f} next step {p.getJointState(arm, 0)[1]:.2f}")
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen restored 1.00 next step 5.00'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
