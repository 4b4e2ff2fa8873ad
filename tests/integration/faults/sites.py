"""The faults of the standing tests, and the calls that get them."""

from __future__ import annotations

import errno
import signal
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Final

from tests.integration.faults.injection import Fault
from tests.integration.faults.suite import MESH

_ALL: Final = 99
_DAY_S: Final = 86_400
_PAUSE_S: Final = 30
_DISK: Final = "create,write,mkdir,rename,sync"
_TMP: Final = "{tmp}/*"
_EVIDENCE: Final = "{output}/traces*:{output}/replays*"
# In the output folder, but not in its folders of evidence.
_REPORTS: Final = "{output}/[!tr]*:{output}/report*:{output}/results*"


_SHORT: Final[Mapping[signal.Signals, Sequence[tuple[int, ...]]]] = {
    signal.SIGTERM: ((2,), (), (13,)),
    signal.SIGHUP: ((), (9,), (17,)),
    signal.SIGKILL: ((), (9,), (15,)),
    signal.SIGQUIT: ((), (), (9,)),
}


def _signals() -> Iterator[Fault]:
    for number in _SHORT:
        to_parent = partial(Fault, f"{number.name} of the command", signal=number, target="parent", most_lost=_ALL)
        starts, writes, reports = _SHORT[number]
        yield to_parent("children start", "fork", role="parent", short=starts)
        yield to_parent("children write", "create,rename", role="child", short=writes)
        yield to_parent("reports", _DISK, _REPORTS, "parent", short=reports)


_no_files = partial(Fault, "EMFILE", calls="open", error=errno.EMFILE)
_no_child = partial(Fault, "EAGAIN", calls="fork", error=errno.EAGAIN)
_killed = partial(Fault, "SIGKILL of a child", role="child", signal=signal.SIGKILL, target="self", most_lost=1)
_full_trace = partial(
    Fault, "ENOSPC on trace", calls=_DISK, paths=_EVIDENCE, role="child", error=errno.ENOSPC, stride=7
)

FAULTS: Final = (
    Fault("ENOSPC on output", "lasting", _DISK, _REPORTS, "parent", lasting=True, error=errno.ENOSPC, short=(1,)),
    Fault("ENOSPC on output", "once", _DISK, _REPORTS, "parent", error=errno.ENOSPC, short=(4,)),
    Fault("EDQUOT on output", "lasting", _DISK, _REPORTS, "parent", lasting=True, error=errno.EDQUOT, short=()),
    Fault("EDQUOT on output", "once", _DISK, _REPORTS, "parent", error=errno.EDQUOT, short=(37,)),
    _full_trace("lasting", lasting=True, short=(1,)),
    _full_trace("once", short=(5,)),
    Fault("ENOSPC on TMPDIR", "lasting", _DISK, _TMP, lasting=True, error=errno.ENOSPC, most_lost=_ALL, short=(7,)),
    Fault("ENOSPC on TMPDIR", "once", _DISK, _TMP, error=errno.ENOSPC, most_lost=1, short=(3,)),
    _no_files("the command, lasting", role="parent", lasting=True, most_lost=_ALL, short=(301,)),
    _no_files("the command, once", role="parent", most_lost=1, short=()),
    _no_files("a child, once", role="child", most_lost=1, short=(21,), stride=7),
    _no_child("the command, lasting", role="parent", lasting=True, most_lost=_ALL),
    _no_child("the command, once", role="parent", short=(2,)),
    _no_child("a child, once", role="child", most_lost=1, suite="mixed", short=()),
    Fault("EIO on mesh", "source", "read", "{suite}/box.stl", error=errno.EIO, exempt=(MESH,)),
    Fault("EIO on mesh", "cached hull", "open,read", "{cache}/*", error=errno.EIO, exempt=(MESH,), short=(3,)),
    *_signals(),
    _killed("it writes", calls="create,rename", short=(7,)),
    _killed("it reads", calls="open", short=(31,), stride=7),
    Fault("clock jump", "a day forward", "clock", lasting=True, jump=_DAY_S, suite="mixed", short=(2,)),
    Fault("clock jump", "a day back", "clock", lasting=True, jump=-_DAY_S, suite="mixed", short=()),
    # As when a machine was paused. The default wall limit is 60 s.
    Fault("clock jump", "half a minute is lost", "monotonic", lasting=True, jump=_PAUSE_S, short=(51,), stride=500),
)
"""All faults; those with the same name are one row of the table in docs/contributing."""
