#!/usr/bin/env bash
# MuJoCo: a plane carries bodies without end, and ends at its size for rays
#
# Packages: mujoco-core 4.0.1, numpy 2.3.5
# Guess: The size of a plane says how far it is drawn, or how far it reaches, for contacts and rays alike.
# Seen: A ball 5 m beside a plane of half-size 1 m rests on it, at 0.1 m; a rangefinder that looks down from the
#   ball sees nothing (-1).
# Matters to: robots with downward range sensors: beyond the drawn floor they stand on ground that they do not see.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet mujoco-core==4.0.1 numpy==2.3.5
cat > try.py <<'END'
import mujoco

MODEL = """<mujoco><worldbody>
  <geom type="plane" size="1 1 0.1"/>
  <body pos="%s 0 0.2"><freejoint/><geom type="sphere" size="0.1"/><site name="down" zaxis="0 0 -1"/></body>
</worldbody><sensor><rangefinder site="down"/></sensor></mujoco>"""
for place in ("0.5", "5"):
    model = mujoco.MjModel.from_xml_string(MODEL % place)
    data = mujoco.MjData(model)
    for _ in range(1000):
        mujoco.mj_step(model, data)
    print(f"seen at {place} m: height {data.qpos[2]:.2f} range {data.sensordata[0]:.2f}")
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen at 0.5 m: height 0.10 range 0.10
seen at 5 m: height 0.10 range -1.00'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
