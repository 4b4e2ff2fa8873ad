#!/usr/bin/env bash
# laspy: new point clouds are rounded to a centimetre
#
# Packages: laspy 2.7.0, numpy 2.3.5
# Guess: Coordinates are floats in memory and keep at least a millimetre until somebody asks for less.
# Seen: 0.1234 m reads back as 0.12 m at once, before any file is written: a new header has the scale 0.01.
# Matters to: lidar data that passes through LAS: the noise of the sensor vanishes under steps of 10 mm.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet laspy==2.7.0 numpy==2.3.5
cat > try.py <<'END'
import laspy
import numpy as np

cloud = laspy.LasData(laspy.LasHeader(point_format=3, version="1.4"))
cloud.x, cloud.y, cloud.z = np.array([0.1234]), np.zeros(1), np.zeros(1)
print(f"seen {cloud.x[0]:.4f} scale {cloud.header.scales[0]:g}")
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen 0.1200 scale 0.01'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
