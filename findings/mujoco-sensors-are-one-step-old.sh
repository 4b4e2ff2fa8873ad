#!/usr/bin/env bash
# MuJoCo: after mj_step the sensors belong to the state before the step
#
# Packages: mujoco-core 4.0.1, numpy 2.3.5
# Guess: data.sensordata and data.qpos describe the same moment.
# Seen: A falling body: the position sensor still has the place before the last step, and the clock sensor shows
#   0.198 s where data.time is 0.200 s.
# Matters to: controllers that mix sensordata and qpos, and logs that stamp sensor values with data.time.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet mujoco-core==4.0.1 numpy==2.3.5
cat > try.py <<'END'
import mujoco

model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody>
  <body pos="0 0 9"><freejoint/><geom size="0.1"/><site name="s"/></body>
</worldbody><sensor><framepos objtype="site" objname="s"/><clock/></sensor></mujoco>""")
data = mujoco.MjData(model)
for _ in range(99):
    mujoco.mj_step(model, data)
before = data.qpos[2]
mujoco.mj_step(model, data)
print(f"seen clock {data.sensordata[3]:.3f} time {data.time:.3f}", "place before the step:", data.sensordata[2] == before)
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen clock 0.198 time 0.200 place before the step: True'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
