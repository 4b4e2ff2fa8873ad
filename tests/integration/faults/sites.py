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


FAULTS: Final = (
    Fault("ENOSPC on output", "lasting", _DISK, _REPORTS, "parent", lasting=True, error=errno.ENOSPC, short=(1,)),
    Fault("ENOSPC on output", "once", _DISK, _REPORTS, "parent", error=errno.ENOSPC, short=(4,)),
    Fault("EDQUOT on output", "lasting", _DISK, _REPORTS, "parent", lasting=True, error=errno.EDQUOT, short=()),
    Fault("EDQUOT on output", "once", _DISK, _REPORTS, "parent", error=errno.EDQUOT, short=(37,)),
    Fault(
        "ENOSPC on trace", "lasting", _DISK, _EVIDENCE, "child", lasting=True, error=errno.ENOSPC, short=(1,), stride=7
    ),
    Fault("ENOSPC on trace", "once", _DISK, _EVIDENCE, "child", error=errno.ENOSPC, short=(5,), stride=7),
    Fault("ENOSPC on TMPDIR", "lasting", _DISK, _TMP, lasting=True, error=errno.ENOSPC, most_lost=_ALL, short=(7,)),
    Fault("ENOSPC on TMPDIR", "once", _DISK, _TMP, error=errno.ENOSPC, most_lost=1, short=(3,)),
    Fault(
        "EMFILE",
        "the command, lasting",
        "open",
        "",
        "parent",
        lasting=True,
        error=errno.EMFILE,
        most_lost=_ALL,
        short=(301,),
    ),
    Fault("EMFILE", "the command, once", "open", "", "parent", error=errno.EMFILE, most_lost=1, short=()),
    Fault("EMFILE", "a child, once", "open", "", "child", error=errno.EMFILE, most_lost=1, short=(21,), stride=7),
    Fault("EAGAIN", "the command, lasting", "fork", "", "parent", lasting=True, error=errno.EAGAIN, most_lost=_ALL),
    Fault("EAGAIN", "the command, once", "fork", "", "parent", error=errno.EAGAIN, short=(2,)),
    Fault("EAGAIN", "a child, once", "fork", "", "child", error=errno.EAGAIN, most_lost=1, suite="mixed", short=()),
    Fault("EIO on mesh", "source", "read", "{suite}/box.stl", error=errno.EIO, exempt=(MESH,)),
    Fault("EIO on mesh", "cached hull", "open,read", "{cache}/*", error=errno.EIO, exempt=(MESH,), short=(3,)),
    *_signals(),
    Fault(
        "SIGKILL of a child",
        "it writes",
        "create,rename",
        "",
        "child",
        signal=signal.SIGKILL,
        target="self",
        most_lost=1,
        short=(7,),
    ),
    Fault(
        "SIGKILL of a child",
        "it reads",
        "open",
        "",
        "child",
        signal=signal.SIGKILL,
        target="self",
        most_lost=1,
        short=(31,),
        stride=7,
    ),
    Fault("clock jump", "a day forward", "clock", lasting=True, jump=_DAY_S, suite="mixed", short=(2,)),
    Fault("clock jump", "a day back", "clock", lasting=True, jump=-_DAY_S, suite="mixed", short=()),
    # As when a machine was paused. The default wall limit is 60 s.
    Fault("clock jump", "half a minute is lost", "monotonic", lasting=True, jump=_PAUSE_S, short=(51,), stride=500),
)
"""All faults; those with the same name are one row of the table in docs/contributing."""
