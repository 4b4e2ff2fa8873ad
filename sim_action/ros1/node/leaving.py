"""How the node is told to leave: by a thread that waits for signals.

rospy's own handler of signals runs between two steps of the main thread, and waits for locks that this may hold: a node
that publishes all the time would never end.
"""

from __future__ import annotations

import signal
import threading
from typing import Final

import rospy

_SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)


def begin(name: str) -> None:
    """Makes this process a node that leaves when it is told to, with all its threads; before any other is started."""
    signal.pthread_sigmask(signal.SIG_BLOCK, _SIGNALS)
    rospy.init_node(name, disable_signals=True)
    threading.Thread(target=_wait, name="leaving", daemon=True).start()


def _wait() -> None:
    told = signal.sigwait(_SIGNALS)
    rospy.signal_shutdown(signal.Signals(told).name)
