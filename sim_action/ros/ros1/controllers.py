"""What the overlay's `controller_manager` package runs: makes rospy known to this interpreter, then calls services.

python -m sim_action.ros.ros1.controllers PROGRAM [ARGUMENT ...]
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path


def main() -> int:
    """The entry of a fresh interpreter; returns the exit code."""
    # As `exchange` has it, which takes longer to import than all that is done here.
    request = Path(os.environ["SIM_ACTION_ROS_RUN"]) / "request.json"
    sys.path.append(json.loads(request.read_bytes())["modules"])
    from sim_action.ros.ros1.node.control.programs import PROGRAMS

    program = sys.argv.pop(1)
    return PROGRAMS[program]()


if __name__ == "__main__":
    sys.exit(main())
