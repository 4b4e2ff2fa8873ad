#!/usr/bin/env bash
# PyBullet: a root link without inertia hangs in the air if it is called world, and falls as 1 kg if not
#
# Packages: pybullet 3.2.7, numpy 2.3.5
# Guess: The name of a link has no meaning: both robots fall, or both are fixed.
# Seen: With a root called "world" the base has no mass and the robot stays at 5 m although useFixedBase is off.
#   With any other name it has 1 kg and falls.
# Matters to: models that are bolted to a link "world", as MoveIt and Gazebo packages have it: renaming the link
#   lets the arm fall.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet pybullet==3.2.7 numpy==2.3.5
cat > try.py <<'END'
import pybullet as p

p.connect(p.DIRECT)
p.setGravity(0, 0, -9.81)
for name in ("world", "world_link"):
    with open(f"{name}.urdf", "w") as file:
        file.write(
            f'<robot name="r"><link name="{name}"/><link name="arm"><inertial><mass value="1"/>'
            '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>'
            f'<joint name="j" type="fixed"><parent link="{name}"/><child link="arm"/></joint></robot>'
        )
    robot = p.loadURDF(f"{name}.urdf", [0, 0, 5])
    for _ in range(24):
        p.stepSimulation()
    height = p.getBasePositionAndOrientation(robot)[0][2]
    # PyBullet writes a warning without a newline before this line.
    print(f"\nseen {name}: mass {p.getDynamicsInfo(robot, -1)[0]:g} falls: {height < 4.99}")
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen world: mass 0 falls: False
seen world_link: mass 1 falls: True'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
