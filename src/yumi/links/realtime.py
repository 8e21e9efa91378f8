"""What the operating system can do for the fast line: priority, memory that stays, no collector."""

from __future__ import annotations

import ctypes
import gc
import os

_PRIORITY = 50
_NICE = -20
_MCL_CURRENT_AND_FUTURE = 3


def prepare_process() -> str:
    """Make this process as prompt as it may be; returns one sentence for the log (reference/performance.md)."""
    gc.collect()
    gc.freeze()
    gc.disable()
    return f"Fast line: {_raise_priority()}, {_lock_memory()}."


def _raise_priority() -> str:
    if hasattr(os, "sched_setscheduler"):
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_PRIORITY))
        except PermissionError:
            return _raise_nice()
        return f"real-time priority {_PRIORITY}"
    return "normal priority"


def _raise_nice() -> str:
    try:
        return f"nice {os.nice(_NICE)} (real-time priority is not permitted)"
    except PermissionError:
        return "normal priority (neither real-time priority nor nice is permitted)"


def _lock_memory() -> str:
    try:
        libc = ctypes.CDLL(None, use_errno=True)
        failed = libc.mlockall(_MCL_CURRENT_AND_FUTURE) != 0
    except (OSError, AttributeError):  # not a POSIX libc
        failed = True
    return "memory not locked (not permitted)" if failed else "memory locked"
