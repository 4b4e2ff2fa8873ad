#!/usr/bin/env bash
# OSQP: a problem that it calls solved passes its bounds by almost one percent
#
# Packages: osqp 1.1.3, numpy 2.3.5, scipy 1.17.1
# Guess: A step of inverse kinematics with |x| <= 0.1 that is solved has no component beyond 0.1, up to rounding.
# Seen: The status is solved, and a component is more than 0.0005 beyond 0.1: eps_abs and eps_rel are 0.001 by
#   default. With 1e-9 it keeps the bounds to 1e-6.
# Matters to: inverse kinematics and model predictive control with joint limits: commands go past the limits that were
#   given.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet osqp==1.1.3 numpy==2.3.5 scipy==1.17.1
cat > try.py <<'END'
import numpy as np
import osqp
import scipy.sparse as sp

rng = np.random.default_rng(0)
problems = [(rng.normal(size=(6, 7)), rng.normal(size=6)) for _ in range(20)]
for name, settings in (("default", {}), ("1e-9", {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iter": 100000})):
    beyond, states = 0.0, set()
    for jacobian, error in problems:
        solver = osqp.OSQP()
        cost = sp.csc_matrix(jacobian.T @ jacobian + 1e-6 * np.eye(7))
        bound = np.full(7, 0.1)
        solver.setup(cost, -jacobian.T @ error, sp.eye(7, format="csc"), -bound, bound, verbose=False, **settings)
        result = solver.solve()
        beyond = max(beyond, np.abs(result.x).max() - 0.1)
        states.add(result.info.status)
    print(f"seen {name}:", *states, f"more than 0.0005 beyond: {beyond > 5e-4} within 1e-6: {beyond < 1e-6}")
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen default: solved more than 0.0005 beyond: True within 1e-6: False
seen 1e-9: solved more than 0.0005 beyond: False within 1e-6: True'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
