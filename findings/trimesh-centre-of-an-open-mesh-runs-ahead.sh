#!/usr/bin/env bash
# trimesh: the centre of mass of an open mesh moves further than the mesh
#
# Packages: trimesh 5.2.0, numpy 2.3.5, scipy 1.17.1
# Guess: A cube without one face has some centre of mass near its middle, and it moves by 5 m when the mesh does.
# Seen: The volume is 0.75 m^3 (of 1 m^3) and the centre moves by 6.67 m. No warning is given; is_watertight is
#   False.
# Matters to: links whose inertia is worked out from an exported mesh: one hole puts the mass beside the link, by an
#   amount that depends on the origin.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet trimesh==5.2.0 numpy==2.3.5 scipy==1.17.1
cat > try.py <<'END'
import numpy as np
import trimesh

cube = trimesh.creation.box((1, 1, 1))
cube.update_faces(np.arange(12) > 1)
before = cube.center_mass[2]
cube.apply_translation([0, 0, 5])
print(f"seen volume {cube.volume:.2f} moved {cube.center_mass[2] - before:.2f} closed {cube.is_watertight}")
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen volume 0.75 moved 6.67 closed False'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
