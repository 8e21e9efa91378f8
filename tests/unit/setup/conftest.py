"""The set-up scripts stand outside the package; their tests import them from their folders."""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT / name) for name in ("setup", "interfaces", "packages/yumi-ros2")]
