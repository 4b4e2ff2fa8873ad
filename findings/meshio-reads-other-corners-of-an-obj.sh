#!/usr/bin/env bash
# meshio: relative indices of an OBJ name other points than they should
#
# Packages: meshio 5.3.5, trimesh 5.2.0, numpy 2.3.5, scipy 1.17.1
# Guess: 'f -4 -3 -2' after four points is the triangle of points 1, 2 and 3, as the format says: -1 is the last
#   point.
# Seen: meshio gives the indices -5, -4 and -3: one lies outside, the others are shifted by one. trimesh reads the
#   right triangle.
# Matters to: scans and exports that are written part by part: faces join points of other parts, or a later step
#   fails.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet meshio==5.3.5 trimesh==5.2.0 numpy==2.3.5 scipy==1.17.1
cat > try.py <<'END'
import meshio
import trimesh

with open("part.obj", "w") as file:
    file.write("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 5 0\nf -4 -3 -2\n")
print("seen meshio:", *meshio.read("part.obj").cells[0].data[0])
print(f"seen trimesh: area {trimesh.load('part.obj').area}")
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen meshio: -5 -4 -3
seen trimesh: area 0.5'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
