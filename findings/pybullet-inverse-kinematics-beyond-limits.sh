#!/usr/bin/env bash
# PyBullet: calculateInverseKinematics stops early and passes joint limits
#
# Packages: pybullet 3.2.7, numpy 2.3.5
# Guess: The joints that it returns bring the tool of a KUKA iiwa within a millimetre of a target in reach, inside
#   the limits of the URDF.
# Seen: With its defaults the tool is more than 50 mm away (20 iterations); with 200 iterations it arrives within
#   0.1 mm, and one joint is beyond its limit.
# Matters to: teams that compute goals of arms with it: the goal is neither exact nor always reachable.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet pybullet==3.2.7 numpy==2.3.5
cat > try.py <<'END'
import math

import pybullet as p
import pybullet_data

p.connect(p.DIRECT)
arm = p.loadURDF(pybullet_data.getDataPath() + "/kuka_iiwa/model.urdf", useFixedBase=True)
TARGET, TOOL = (0.3, 0.2, 0.5), 6
LIMITS = [p.getJointInfo(arm, joint)[8:10] for joint in range(7)]


def solve(**options):
    for joint in range(7):
        p.resetJointState(arm, joint, 0)
    angles = p.calculateInverseKinematics(arm, TOOL, TARGET, **options)
    for joint, angle in enumerate(angles):
        p.resetJointState(arm, joint, angle)
    error = math.dist(p.getLinkState(arm, TOOL)[4], TARGET)
    return error, sum(not low <= angle <= high for angle, (low, high) in zip(angles, LIMITS))


error, _ = solve()
print("seen by default more than 50 mm away:", error > 0.05)
error, beyond = solve(maxNumIterations=200)
print("seen 200 iterations less than 0.1 mm away:", error < 1e-4, "joints beyond their limits:", beyond)
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen by default more than 50 mm away: True
seen 200 iterations less than 0.1 mm away: True joints beyond their limits: 1'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
