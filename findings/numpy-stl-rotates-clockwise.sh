#!/usr/bin/env bash
# numpy-stl: Mesh.rotate turns clockwise, Mesh.transform counterclockwise
#
# Packages: numpy-stl 4.1.1, numpy 2.3.5
# Guess: rotate([0, 0, 1], 90 deg) follows the right hand, as a rotation matrix that is given to transform does: x
#   becomes y.
# Seen: rotate brings (1, 0, 0) to (0, -1, 0), transform brings it to (0, 1, 0).
# Matters to: meshes that are turned upright before they go into a robot model: a wheel lies on its other side.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet numpy-stl==4.1.1 numpy==2.3.5
cat > try.py <<'END'
import math

import numpy as np
from stl import mesh


def corner(turn):
    data = np.zeros(1, dtype=mesh.Mesh.dtype)
    data["vectors"][0] = [[0, 0, 0], [1, 0, 0], [1, 0, 1]]
    body = mesh.Mesh(data)
    turn(body)
    return " ".join(f"{value + 0:.0f}" for value in body.vectors[0][1].round(6))


quarter = np.eye(4)
quarter[:2, :2] = [[0, -1], [1, 0]]
print("seen rotate:", corner(lambda body: body.rotate([0, 0, 1], math.radians(90))))
print("seen transform:", corner(lambda body: body.transform(quarter)))
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen rotate: 0 -1 0
seen transform: 0 1 0'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
