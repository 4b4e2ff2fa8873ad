#!/usr/bin/env bash
# PyBullet: the number of a removed body is given to the next one
#
# Packages: pybullet 3.2.7, numpy 2.3.5
# Guess: A number is used once, so an old number raises an error after removeBody.
# Seen: The next body that is created gets the number of the removed one.
# Matters to: code that keeps numbers of bodies (contact lists, logs): it speaks of another body without an error.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet pybullet==3.2.7 numpy==2.3.5
cat > try.py <<'END'
import pybullet as p

p.connect(p.DIRECT)
ball = p.createCollisionShape(p.GEOM_SPHERE, radius=0.1)
first, second = p.createMultiBody(1, ball), p.createMultiBody(1, ball)
p.removeBody(first)
print("seen", first, second, p.createMultiBody(1, ball))
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen 0 1 0'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
