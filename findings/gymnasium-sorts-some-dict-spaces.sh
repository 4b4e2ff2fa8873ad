#!/usr/bin/env bash
# gymnasium: Dict({...}) sorts its keys, Dict(key=...) keeps their order
#
# Packages: gymnasium 1.4.0, numpy 2.3.5
# Guess: Two ways to write the same space give the same flat observation: either sorted by name or as written.
# Seen: Dict(velocity=..., angle=...) is flattened in this order, Dict({'velocity': ..., 'angle': ...}) as angle,
#   velocity.
# Matters to: policies on flattened observations: a network that was trained with one spelling gets its inputs swapped
#   with the other.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet gymnasium==1.4.0 numpy==2.3.5
cat > try.py <<'END'
import numpy as np
from gymnasium.spaces import Box, Dict, flatten

parts = {"velocity": Box(-9, 9, (1,)), "angle": Box(-9, 9, (1,))}
value = {"velocity": np.float32([7]), "angle": np.float32([0])}
print("seen by keywords:", flatten(Dict(**parts), value))
print("seen by a dictionary:", flatten(Dict(parts), value))
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen by keywords: [7. 0.]
seen by a dictionary: [0. 7.]'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
