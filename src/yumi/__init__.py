"""Drive an ABB IRB 14000 YuMi from ROS 2 or plain Python."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from yumi.hardware.egm_server import EgmServer

__version__ = "0.1.0"
__all__ = ["EgmServer", "__version__"]


def __getattr__(name: str) -> object:
    """Load what the package offers when it is asked for; ``import yumi`` itself loads nothing."""
    if name == "EgmServer":
        from yumi.hardware.egm_server import EgmServer  # noqa: PLC0415

        return EgmServer
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
