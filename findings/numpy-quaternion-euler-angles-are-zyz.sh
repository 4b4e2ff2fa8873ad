#!/usr/bin/env bash
# numpy-quaternion: as_euler_angles does not give roll, pitch and yaw
#
# Packages: numpy-quaternion 2024.0.13, numpy 2.3.5
# Guess: Three angles of a quaternion are roll, pitch and yaw in some order.
# Seen: They are of the z-y-z convention: a robot that only pitches by 0.2 rad has (0, 0.2, 0), and one that only
#   rolls by 0.2 rad has (-pi/2, 0.2, pi/2).
# Matters to: plots and checks of attitude: while the robot is level or only turns they look right.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet numpy-quaternion==2024.0.13 numpy==2.3.5
cat > try.py <<'END'
import numpy as np
import quaternion

for name, axis in (("roll", [1, 0, 0]), ("pitch", [0, 1, 0]), ("yaw", [0, 0, 1])):
    angles = quaternion.as_euler_angles(quaternion.from_rotation_vector(0.2 * np.array(axis)))
    print(f"seen {name} 0.2:", *(f"{angle + 0:.2f}" for angle in angles))
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen roll 0.2: -1.57 0.20 1.57
seen pitch 0.2: 0.00 0.20 0.00
seen yaw 0.2: 0.10 0.00 0.10'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
