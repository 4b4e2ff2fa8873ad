#!/usr/bin/env bash
# PyBullet: the child of a planar joint is placed with its centre of mass at the joint
#
# Packages: pybullet 3.2.7, numpy 2.3.5
# Guess: The frame of the child starts at the joint, (0, 0, 0.5), whatever kind of joint it is and wherever its mass
#   is.
# Seen: With a fixed joint it is there. With a planar joint it is at (-0.1, -0.2, 0.2): the centre of mass, (0.1, 0.2,
#   0.3) in the frame of the child, was put at the joint.
# Matters to: robots on planar joints (bases that slide, tables with two axes): all links above stand beside their
#   place.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet pybullet==3.2.7 numpy==2.3.5
cat > try.py <<'END'
import pybullet as p

INERTIA = '<mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
MODEL = f"""<robot name="r"><link name="a"><inertial>{INERTIA}</inertial></link>
<link name="b"><inertial><origin xyz="0.1 0.2 0.3"/>{INERTIA}</inertial></link>
<joint name="j" type="%s"><parent link="a"/><child link="b"/><origin xyz="0 0 0.5"/><axis xyz="0 0 1"/></joint></robot>"""
p.connect(p.DIRECT)
for kind in ("fixed", "planar"):
    with open(f"{kind}.urdf", "w") as file:
        file.write(MODEL % kind)
    robot = p.loadURDF(f"{kind}.urdf", useFixedBase=True)
    place = p.getLinkState(robot, 0, computeForwardKinematics=True)[4]
    print("seen", kind, *(f"{value:.1f}" for value in place))
    p.resetSimulation()
END
seen=$(venv/bin/python try.py 2> /dev/null | grep '^seen')
stated='seen fixed 0.0 0.0 0.5
seen planar -0.1 -0.2 0.2'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
