"""What the overlay's `gzserver` runs: makes rospy known to this interpreter, then serves."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from sim_action.ros1.exchange import FOLDER_VARIABLE, REQUEST_FILE, Request


def main() -> None:
    """The entry of a fresh interpreter."""
    folder = Path(os.environ[FOLDER_VARIABLE])
    request = Request.model_validate_json((folder / REQUEST_FILE).read_bytes())
    # Behind what is ours: the distribution's other packages are for another Python.
    sys.path.append(request.modules)
    from sim_action.ros1.node.gzserver import serve

    serve(folder, request)


if __name__ == "__main__":
    main()
