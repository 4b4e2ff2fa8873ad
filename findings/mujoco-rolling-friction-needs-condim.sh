#!/usr/bin/env bash
# MuJoCo: rolling friction of a geom does nothing at the default condim
#
# Packages: mujoco-core 4.0.1, numpy 2.3.5
# Guess: friction="1 0.005 0.1" gives a ball of radius 0.1 m a rolling resistance that stops it within a second from
#   1 m/s.
# Seen: With the default condim 3 the ball still rolls at 1.00 m/s after 5 s; with condim 6 it has stopped. No
#   warning is given.
# Matters to: models with rolling wheels and balls: the third number of friction is read and has no effect.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet mujoco-core==4.0.1 numpy==2.3.5
cat > try.py <<'END'
import mujoco

MODEL = """<mujoco><worldbody>
  <geom type="plane" size="9 9 0.1"/>
  <body pos="0 0 0.1"><freejoint/><geom type="sphere" size="0.1" friction="1 0.005 0.1" condim="%d"/></body>
</worldbody></mujoco>"""
for dimensions in (3, 6):
    model = mujoco.MjModel.from_xml_string(MODEL % dimensions)
    data = mujoco.MjData(model)
    data.qvel[0], data.qvel[4] = 1, 10
    for _ in range(2500):
        mujoco.mj_step(model, data)
    print(f"seen condim {dimensions}: {abs(data.qvel[0]):.2f} m/s after 5 s")
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen condim 3: 1.00 m/s after 5 s
seen condim 6: 0.00 m/s after 5 s'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
