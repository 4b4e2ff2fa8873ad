"""An interpreter that lacks what Python lacks on macOS or Windows, and so takes the paths that are taken there.

It is no macOS and no Windows: files, processes and sockets stay those of this machine. What it shows is that nothing is
asked of Python that is not there.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final, Literal

System = Literal["darwin", "win32"]
ROOT: Final = Path(__file__).parents[2]

# What is run before everything else, in each interpreter that has this in its PYTHONPATH. Absent there are, by the
# documentation of Python, `os.waitid` (until 3.13), `os.sched_getaffinity`, prctl and PyBullet on macOS, and on Windows
# whatever is POSIX.
_DARWIN: Final = """
import os, sys, sysconfig
# What Python itself keeps apart by the name of the system is on this machine.
sysconfig.get_config_vars()
sys.modules["pybullet"] = None
def hide(module, names):
    for name in names:
        vars(module).pop(name, None)
hide(os, ["sched_getaffinity", "sched_setaffinity", "waitid", "P_PID", "P_ALL", "CLD_EXITED"])
import ctypes
class NoPrctl(ctypes.CDLL):
    def __getattr__(self, name):
        if name == "prctl":
            raise AttributeError(name)
        return super().__getattr__(name)
ctypes.CDLL = NoPrctl
sys.platform = "darwin"
"""
_WINDOWS: Final = """
import ctypes, os, select, shutil, signal, socket, stat, subprocess, sys, sysconfig, types
sysconfig.get_config_vars()
# Other packages ask for the system when they are imported: they are to believe in their own.
import click, mujoco, numpy, pydantic, xacro, yaml
import fcntl
def locking(descriptor, mode, size, lockf=fcntl.lockf, how=fcntl.LOCK_EX | fcntl.LOCK_NB):
    lockf(descriptor, how, size, os.lseek(descriptor, 0, os.SEEK_CUR))
sys.modules["msvcrt"] = types.SimpleNamespace(locking=locking, LK_NBLCK=2)
for name in ("fcntl", "grp", "pwd", "pybullet", "resource", "termios", "tty"):
    sys.modules[name] = None
# Python's own parts are to go on.
subprocess.signal = types.SimpleNamespace(**vars(signal))
shutil.os = subprocess.os = types.SimpleNamespace(**vars(os))
def hide(module, names):
    for name in names.split():
        vars(module).pop(name, None)
hide(os, "fork forkpty wait wait3 wait4 waitid killpg getpgid setpgid setsid getsid getuid geteuid getppgid mkfifo "
         "uname sched_getaffinity set_blocking O_NONBLOCK O_NOFOLLOW O_DIRECTORY O_CLOEXEC WNOHANG P_PID P_ALL "
         "CLD_EXITED chown lchown getloadavg openpty pread pwrite sysconf register_at_fork")
hide(signal, "SIGKILL SIGCHLD SIGSTOP SIGCONT SIGBUS SIGHUP SIGPIPE SIGALRM pthread_sigmask sigwait "
             "SIG_BLOCK SIG_UNBLOCK")
def only_sockets(readers, writers, others, timeout=None, select=select.select):
    for one in (*readers, *writers, *others):
        if not stat.S_ISSOCK(os.fstat(one if isinstance(one, int) else one.fileno()).st_mode):
            raise OSError(10038, "an operation was attempted on something that is not a socket")
    return select(readers, writers, others, timeout)
select.select = only_sockets
def no_library_of_none(name, *arguments, load=ctypes.CDLL):
    if name is None:
        raise TypeError("bad argument type for built-in operation")
    return load(name, *arguments)
ctypes.CDLL = no_library_of_none
sys.platform = "win32"
"""
_SITES: Final = {"darwin": _DARWIN, "win32": _WINDOWS}


def variables_of(system: System, folder: Path) -> dict[str, str]:
    """The environment in which interpreters, and those that they start, are like those of a system."""
    site = folder / f"site-{system}"
    site.mkdir()
    (site / "sitecustomize.py").write_text(_SITES[system], encoding="utf-8")
    kept = {name: value for name, value in os.environ.items() if not name.startswith("GITHUB_")}
    return {**kept, "PYTHONPATH": os.pathsep.join((str(site), str(ROOT)))}
