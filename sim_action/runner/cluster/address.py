"""The address of a cluster as it is typed: `tcp://HOST:PORT`, `tls://HOST:PORT` or `local:N`."""

from __future__ import annotations

import re
from importlib.util import find_spec
from typing import Final, Self

from sim_action.core.errors import UsageError
from sim_action.core.records import dataclass
from sim_action.core.wording import shown

_LOCAL: Final = re.compile(r"local:([1-9][0-9]{0,2})")
_SCHEDULER: Final = re.compile(r"(tcp|tls)://([\w.-]+|\[[0-9A-Fa-f:.]+\]):([0-9]{1,5})")
_MOST_LOCAL: Final = 256
_LAST_PORT: Final = 65_535


@dataclass(frozen=True, slots=True)
class ClusterAddress:
    """An address; `workers`: the number of workers to start on this machine, None for a cluster that exists."""

    text: str
    workers: int | None = None

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the address. Raise UsageError, also if Dask is not installed."""
        local = _LOCAL.fullmatch(text)
        address = cls(text, int(local[1]) if local else None)
        scheduler = _SCHEDULER.fullmatch(text)
        is_port = scheduler is not None and 0 < int(scheduler[3]) <= _LAST_PORT
        if not (is_port if address.workers is None else address.workers <= _MOST_LOCAL):
            raise UsageError(
                f"--cluster takes the address of a Dask scheduler, such as tcp://10.0.0.5:8786, or local:N with 1 to "
                f"{_MOST_LOCAL} workers; found {shown(text)}"
            )
        if find_spec("distributed") is None:
            raise UsageError(
                "--cluster needs the package distributed, which is not installed: pip install 'sim-action[dask]'"
            )
        return address
