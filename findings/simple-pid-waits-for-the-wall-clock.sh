#!/usr/bin/env bash
# simple-pid: a controller called faster than real time repeats its last output
#
# Packages: simple-pid 2.0.1
# Guess: Each call computes an output for the value that it is given.
# Seen: Calls within 10 ms of wall time (the default sample_time) return the old output: errors of 1, 0.5 and -3 all
#   give -1. In a simulation that runs faster than real time the controller is frozen most of the time, and its
#   integral counts wall time.
# Matters to: controllers in fast simulations: pass dt, or time_fn with the simulated clock, and sample_time=None.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet simple-pid==2.0.1
cat > try.py <<'END'
from simple_pid import PID

# The clock of the controller stands still here, as it nearly does between two steps of a fast simulation.
frozen = PID(1, 0, 0, setpoint=0, time_fn=lambda: 5.0)
print("seen", *(f"{frozen(value):g}" for value in (1, 0.5, -3)))
told = PID(1, 0, 0, setpoint=0, sample_time=None)
print("seen with dt", *(f"{told(value, dt=0.01):g}" for value in (1, 0.5, -3)))
END
seen=$(venv/bin/python try.py | grep '^seen')
stated='seen -1 -1 -1
seen with dt -1 -0.5 3'
if [ "$seen" != "$stated" ]; then
  printf 'It has changed. Seen:\n%s\nStated:\n%s\n' "$seen" "$stated"
  exit 1
fi
printf '%s\n' "$seen"
