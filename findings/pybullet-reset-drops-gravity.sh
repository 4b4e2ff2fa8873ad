#!/usr/bin/env bash
# PyBullet: resetSimulation sets gravity to zero
#
# Packages: pybullet 3.2.7, numpy 2.3.5
# Guess: Gravity is a setting of the world, as the time step is, and survives a reset.
# Seen: After resetSimulation a ball does not fall: its speed after one step is 0. The time step of the same call
#   does survive.
# Matters to: suites that reset one connection between tests: the second test runs without weight and may pass.
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
p.setTimeStep(0.01)


def speed_after_one_step():
    ball = p.createMultiBody(1, p.createCollisionShape(p.GEOM_SPHERE, radius=0.1), basePosition=[0, 0, 5])
    p.changeDynamics(ball, -1, linearDamping=0)
    p.stepSimulation()
    return p.getBaseVelocity(ball)[0][2]


before = speed_after_one_step()
p.resetSimulation()
after = speed_after_one_step()
step = p.getPhysicsEngineParameters()["fixedTimeStep"]
print(f"seen before {before:.3f} after {after:.3f} step {step:.3f}")
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen before -0.100 after 0.000 step 0.010'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
