"""Drive towards the wall, slow down near it, and stop half a metre before it."""

import json
import sys

WALL = 2.95  # m, its near side
GAP = 0.5  # m
FRONT = 0.038  # m, from the origin of the burger to its front
TOP_SPEED = 0.5  # m/s
GAIN = 2.0  # 1/s

for line in sys.stdin:
    seen = json.loads(line)
    if seen["type"] == "step":
        x, _, _ = seen["pose"]["position_xyz"]
        left = WALL - GAP - FRONT - x
        answer = {"twist": {"linear": max(0.0, min(TOP_SPEED, GAIN * left))}}
    else:
        # The first line describes the robot; it needs no command yet.
        print("drives", seen["robot"]["name"], file=sys.stderr)
        answer = {}
    print(json.dumps(answer), flush=True)
