#!/usr/bin/env bash
# PyBullet: with substeps, contact forces are divided by their number
#
# Packages: pybullet 3.2.7, numpy 2.3.5
# Guess: A ball of 2 kg at 10 m/s^2 presses on the ground with 20 N, whatever the solver does inside of a step.
# Seen: 20 N without substeps, 5 N with numSubSteps=4: the impulse of the last substep is divided by the whole step.
# Matters to: limits of grip and contact forces: finer substeps for accuracy make them pass.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet pybullet==3.2.7 numpy==2.3.5
cat > try.py <<'END'
import pybullet as p

p.connect(p.DIRECT)
p.setGravity(0, 0, -10)
plane = p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE))
ball = p.createMultiBody(2, p.createCollisionShape(p.GEOM_SPHERE, radius=0.1), basePosition=[0, 0, 0.1])
for substeps in (0, 4):
    p.setPhysicsEngineParameter(numSubSteps=substeps)
    for _ in range(480):
        p.stepSimulation()
    print("seen", substeps, "substeps:", *(f"{contact[9]:.1f} N" for contact in p.getContactPoints(ball, plane)))
END
seen=$(venv/bin/python try.py 2> /dev/null | grep '^seen')
stated='seen 0 substeps: 20.0 N
seen 4 substeps: 5.0 N'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
