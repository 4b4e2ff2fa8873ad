#!/usr/bin/env bash
# PyBullet: a box that falls flat on a plane lands on one corner, and tips
#
# Packages: pybullet 3.2.7, numpy 2.3.5
# Guess: A box of 15 cm that falls level lands on its four corners at once and stays level, as on any flat ground.
# Seen: On GEOM_PLANE it tips by 0.5 deg from 1 cm and by 6.8 deg from 1 m, because a plane gets one contact point in a
#   step. At 960 steps per second it is 1.3 deg from 1 m. On a large GEOM_BOX it stays level at any height and rate.
# Matters to: landings of drones, legged robots and dropped parts: "stays upright" can fail although nothing turned them.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet pybullet==3.2.7 numpy==2.3.5
cat > try.py <<'END'
import math

import pybullet as p

p.connect(p.DIRECT)


def tilt(ground, height, rate):
    """Return the largest tilt in deg of a box that falls level."""
    p.resetSimulation()
    p.setGravity(0, 0, -9.80665)
    p.setTimeStep(1 / rate)
    if ground == "plane":
        p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE))
    else:
        p.createMultiBody(0, p.createCollisionShape(p.GEOM_BOX, halfExtents=[50, 50, 0.5]), basePosition=[0, 0, -0.5])
    shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.075, 0.075, 0.08])
    box, most = p.createMultiBody(1.5, shape, basePosition=[0, 0, 0.08 + height]), 0.0
    for _ in range(2 * rate):
        p.stepSimulation()
        upright = p.getMatrixFromQuaternion(p.getBasePositionAndOrientation(box)[1])[8]
        most = max(most, math.degrees(math.acos(min(1.0, upright))))
    return most


for ground, rate in (("plane", 240), ("plane", 960), ("box", 240)):
    print("seen", ground, rate, "Hz:", *(f"{tilt(ground, height, rate):.1f}" for height in (0.01, 0.1, 1)), "deg")
END
seen=$(venv/bin/python try.py 2> /dev/null | grep '^seen')
stated='seen plane 240 Hz: 0.5 2.3 6.8 deg
seen plane 960 Hz: 0.0 0.1 1.3 deg
seen box 240 Hz: 0.0 0.0 0.0 deg'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
