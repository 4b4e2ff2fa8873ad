#!/usr/bin/env bash
# numpy-stl: Mesh.from_file returns the first solid of an ASCII STL
#
# Packages: numpy-stl 4.1.1, trimesh 5.2.0, numpy 2.3.5, scipy 1.17.1
# Guess: A file of two solids gives the triangles of both.
# Seen: numpy-stl returns 1 of 2 triangles without a word, trimesh both. Mesh.from_multi_file is the function that
#   reads all.
# Matters to: assemblies of CAD programs, which write a solid for each part: volume, mass and bounds are those of one
#   part.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet numpy-stl==4.1.1 trimesh==5.2.0 numpy==2.3.5 scipy==1.17.1
cat > try.py <<'END'
import trimesh
from stl import mesh

SOLID = """solid {0}
facet normal 0 0 1
outer loop
vertex 0 0 {0}
vertex 1 0 {0}
vertex 0 1 {0}
endloop
endfacet
endsolid {0}
"""
with open("two.stl", "w") as file:
    file.write(SOLID.format(1) + SOLID.format(2))
print("seen numpy-stl:", len(mesh.Mesh.from_file("two.stl").vectors))
print("seen trimesh:", len(trimesh.load_mesh("two.stl").faces))
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen numpy-stl: 1
seen trimesh: 2'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
