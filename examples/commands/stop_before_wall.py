"""Drive towards the wall, slow down near it, and stop half a metre in front of it."""

import json
import sys

WALL_FACE_X = 2.95  # m, x of the side of the wall that faces the robot
GAP = 0.5  # m, between the wall and the robot
FRONT = 0.038  # m, from the origin of the burger to its front
TOP_SPEED = 0.5  # m/s
GAIN = 2.0  # 1/s

for line in sys.stdin:
    seen = json.loads(line)
    if seen["type"] == "step":
        x, _, _ = seen["pose"]["position_xyz"]
        remaining = WALL_FACE_X - GAP - FRONT - x
        answer = {"twist": {"linear": max(0.0, min(TOP_SPEED, GAIN * remaining))}}
    else:
        # The first line describes the robot; it needs no command yet.
        print("drives", seen["robot"]["name"], file=sys.stderr)
        answer = {}
    print(json.dumps(answer), flush=True)
