#!/usr/bin/env bash
# toppra: its trajectory exceeds the acceleration limit on a straight line
#
# Packages: toppra 0.6.10, numpy 2.3.5, scipy 1.17.1
# Guess: A joint that goes from 0 to 1 rad under the limits 1 rad/s and 2 rad/s^2 keeps both, up to rounding.
# Seen: The speed is within 0.5 %. The acceleration is more than 10 % above its limit, on the default grid and on 2000
#   points: the trajectory is a spline through the computed points.
# Matters to: tests that check a planner's acceleration limit on the trajectory, and drives that refuse set points
#   beyond it.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet toppra==0.6.10 numpy==2.3.5 scipy==1.17.1
cat > try.py <<'END'
import numpy as np
import toppra
from toppra.algorithm import TOPPRA
from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint

toppra.setup_logging("ERROR")
path = toppra.SplineInterpolator(np.linspace(0, 1, 2), np.array([[0.0], [1.0]]))
limits = [JointVelocityConstraint([1]), JointAccelerationConstraint([2])]
for name, options in (("default grid", {}), ("2000 points", {"gridpoints": np.linspace(0, 1, 2001)})):
    trajectory = TOPPRA(limits, path, **options).compute_trajectory()
    times = np.linspace(0, trajectory.duration, 50000)
    speed, acceleration = (np.abs(trajectory(times, order)).max() for order in (1, 2))
    print(f"seen {name}: speed kept: {speed < 1.005} acceleration more than 10 % above: {acceleration > 2.2}")
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen default grid: speed kept: True acceleration more than 10 % above: True
seen 2000 points: speed kept: True acceleration more than 10 % above: True'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
