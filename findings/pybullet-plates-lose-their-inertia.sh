#!/usr/bin/env bash
# PyBullet: a flat plate can lose its whole inertia to rounding
#
# Packages: pybullet 3.2.7, numpy 2.3.5
# Guess: A thin plate has moments of which two add up to the third. 0.1, 0.7 and 0.8 are as good as 0.1, 0.2 and 0.3.
# Seen: 0.1, 0.2 and 0.3 are kept. 0.1, 0.7 and 0.8 become 0, 0 and 0 with a warning on standard error, because 0.1 +
#   0.7 is a little less than 0.8 in binary.
# Matters to: plates, wheels and thin links of CAD exports: whether they can be turned by a torque depends on the last
#   bit.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet pybullet==3.2.7 numpy==2.3.5
cat > try.py <<'END'
import pybullet as p

MODEL = """<robot name="r"><link name="a"><inertial><mass value="1"/>
<inertia ixx="%s" iyy="%s" izz="%s" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""
p.connect(p.DIRECT)
for moments in ((0.1, 0.2, 0.3), (0.1, 0.7, 0.8)):
    with open(f"{moments[1]}.urdf", "w") as file:
        file.write(MODEL % moments)
    robot = p.loadURDF(f"{moments[1]}.urdf", flags=p.URDF_USE_INERTIA_FROM_FILE)
    print("seen", *moments, "as", *(f"{value:.1f}" for value in p.getDynamicsInfo(robot, -1)[2]))
    p.resetSimulation()
END
seen=$(venv/bin/python try.py 2> /dev/null | grep '^seen')
stated='seen 0.1 0.2 0.3 as 0.1 0.2 0.3
seen 0.1 0.7 0.8 as 0.0 0.0 0.0'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
