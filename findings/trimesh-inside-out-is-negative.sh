#!/usr/bin/env bash
# trimesh: a mesh whose faces look inwards has a negative mass and inertia, MuJoCo takes it as it is meant
#
# Packages: trimesh 5.2.0, mujoco-core 4.0.1, numpy 2.3.5, scipy 1.17.1
# Guess: Mass is positive, or the mesh is refused.
# Seen: trimesh: mass -1 and inertia -0.17 for a cube of 1 m; MuJoCo compiles the same file to 1000 kg and +167 kg
#   m^2.
# Matters to: scripts that write <inertial> elements from meshes of CAD programs.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet trimesh==5.2.0 mujoco-core==4.0.1 numpy==2.3.5 scipy==1.17.1
cat > try.py <<'END'
import mujoco
import trimesh

cube = trimesh.creation.box((1, 1, 1))
cube.invert()
cube.export("cube.stl")
print(f"seen trimesh {cube.mass:.2f} {cube.moment_inertia[0, 0]:.2f}")
model = mujoco.MjModel.from_xml_string("""<mujoco><asset><mesh name="m" file="cube.stl"/></asset>
  <worldbody><body><freejoint/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>""")
print(f"seen mujoco {model.body_mass[1]:.0f} {model.body_inertia[1, 0]:.0f}")
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen trimesh -1.00 -0.17
seen mujoco 1000 167'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
