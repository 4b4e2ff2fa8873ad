#!/usr/bin/env bash
# MuJoCo: Euler angles of an MjSpec body are ignored until their type is set, and then are degrees
#
# Packages: mujoco-core 4.0.1, numpy 2.3.5
# Guess: body.alt.euler = [0, 0, 1.5708] turns a body by 90 deg: the Python interface takes radians.
# Seen: Alone it does nothing, without an error. With body.alt.type = mjORIENTATION_EULER the body turns by 1.57
#   deg, because the compiler of a new MjSpec reads degrees.
# Matters to: models that are built in Python: sensors and tools keep the orientation of their parent.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet mujoco-core==4.0.1 numpy==2.3.5
cat > try.py <<'END'
import math

import mujoco


def turned_deg(with_type):
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body()
    body.alt.euler = [0, 0, 1.5708]
    if with_type:
        body.alt.type = mujoco.mjtOrientation.mjORIENTATION_EULER
    body.add_geom(size=[0.1, 0.1, 0.1])
    w, _, _, z = spec.compile().body_quat[1]
    return math.degrees(2 * math.atan2(z, w))


print(f"seen without a type {turned_deg(False):.2f} deg, with a type {turned_deg(True):.2f} deg")
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen without a type 0.00 deg, with a type 1.57 deg'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
