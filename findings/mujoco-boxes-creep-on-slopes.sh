#!/usr/bin/env bash
# MuJoCo: a box creeps down a slope that friction should hold it on
#
# Packages: mujoco-core 4.0.1, numpy 2.3.5
# Guess: Friction 1 holds a box on a slope of 30 deg (tangent 0.58): it does not move.
# Seen: It slides 33 mm in 10 s with the default (pyramidal) cone and 16 mm with the elliptic one, at constant
#   speed.
# Matters to: tests of parked robots, grasps and loads on conveyors: "stands still" needs noslip iterations, another
#   solver setting or a tolerance for each second.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet mujoco-core==4.0.1 numpy==2.3.5
cat > try.py <<'END'
import mujoco

MODEL = """<mujoco><option gravity="4.905 0 -8.4957" cone="%s"/><worldbody>
  <geom type="plane" size="9 9 0.1" friction="1"/>
  <body pos="0 0 0.1"><freejoint/><geom type="box" size="0.1 0.1 0.1" friction="1"/></body>
</worldbody></mujoco>"""
for cone in ("pyramidal", "elliptic"):
    model = mujoco.MjModel.from_xml_string(MODEL % cone)
    data = mujoco.MjData(model)
    for _ in range(500):
        mujoco.mj_step(model, data)
    start = data.qpos[0]
    for _ in range(5000):
        mujoco.mj_step(model, data)
    print(f"seen {cone}: {1000 * (data.qpos[0] - start):.0f} mm in 10 s")
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen pyramidal: 33 mm in 10 s
seen elliptic: 16 mm in 10 s'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
