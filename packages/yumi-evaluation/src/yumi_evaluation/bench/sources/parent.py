"""What every server of the benchmark does at its start: end with its parent, and say when it listens."""

from __future__ import annotations

import ctypes
import signal

_PR_SET_PDEATHSIG = 1


def end_with_parent() -> None:
    """Be killed when the parent dies, so that an interrupted benchmark leaves no process behind."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def say_ready(*pids: int) -> None:
    """Print that datagrams are answered, and by which processes."""
    print("ready", *pids, flush=True)
