#!/usr/bin/env bash
# pyquaternion: yaw_pitch_roll are not the angles that build the rotation in this order
#
# Packages: pyquaternion 0.9.9, scipy 1.17.1, numpy 2.3.5
# Guess: A rotation built by yaw 0.3, then pitch 0.2, then roll 0.1 (turned axes) gives these three numbers back.
# Seen: It gives 0.29, 0.22 and 0.04. The property holds the angles of the order roll, pitch, yaw about turned axes.
#   With one angle alone both agree.
# Matters to: attitude checks against other tools, which use yaw, pitch, roll about turned axes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet pyquaternion==0.9.9 scipy==1.17.1 numpy==2.3.5
cat > try.py <<'END'
from pyquaternion import Quaternion
from scipy.spatial.transform import Rotation

x, y, z, w = Rotation.from_euler("ZYX", [0.3, 0.2, 0.1]).as_quat()
print("seen", *(f"{angle:.2f}" for angle in Quaternion(w, x, y, z).yaw_pitch_roll))
x, y, z, w = Rotation.from_euler("XYZ", [0.1, 0.2, 0.3]).as_quat()
print("seen other order", *(f"{angle:.2f}" for angle in Quaternion(w, x, y, z).yaw_pitch_roll))
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen 0.29 0.22 0.04
seen other order 0.30 0.20 0.10'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
