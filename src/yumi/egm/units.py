"""The wire units of EGM: degrees, millimetres, microseconds and percent; everything inside is SI."""

from __future__ import annotations

from math import pi
from struct import pack, unpack

RAD_PER_DEG = pi / 180.0
DEG_PER_RAD = 180.0 / pi
M_PER_MM = 1e-3
MM_PER_M = 1e3
UINT32 = 2**32
NS_PER_S = 1_000_000_000


def clock_fields(seconds: float) -> tuple[int, int]:
    """Split a controller time [s] into EgmClock's whole seconds and microseconds."""
    microseconds = round(seconds * 1e6)
    return microseconds // 1_000_000, microseconds % 1_000_000


def single(value: float) -> float:
    """Round to single precision, in which the controller computes (reference/egm.md §2.4)."""
    return float(unpack("<f", pack("<f", value))[0])
