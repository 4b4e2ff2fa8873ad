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
_left: Final = threading.Event()


def begin(name: str) -> None:
    """Makes this process a node that leaves when it is told to, with all its threads; before any other is started."""
    signal.pthread_sigmask(signal.SIG_BLOCK, _SIGNALS)
    rospy.init_node(name, disable_signals=True)
    # Called after those of rospy itself: the master knows by then that this node has gone.
    rospy.core.add_shutdown_hook(lambda _: _left.set())
    threading.Thread(target=_wait, name="leaving", daemon=True).start()


def wait() -> None:
    """Returns once the node has left; rospy.spin() would look for that every half a second."""
    _left.wait()


def _wait() -> None:
    told = signal.sigwait(_SIGNALS)
    rospy.signal_shutdown(signal.Signals(told).name)
