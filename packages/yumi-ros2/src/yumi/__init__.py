"""The driver of an ABB IRB 14000 YuMi, for ROS 2 and plain Python."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from abb_protocols.catalogue import add_texts

if TYPE_CHECKING:
    from abb_protocols import errors
    from yumi.api.attach import attach
    from yumi.api.chunks import Chunk
    from yumi.api.connect import connect, connect_async
    from yumi.api.joint_positions import abb_degrees, degrees, in_degrees
    from yumi.api.poses import pose
    from yumi.driver.egm_server import EgmServer
    from yumi.recording.tables import read_recording

__version__ = "0.1.0"
__all__ = [
    "Chunk",
    "EgmServer",
    "__version__",
    "abb_degrees",
    "attach",
    "connect",
    "connect_async",
    "degrees",
    "errors",
    "in_degrees",
    "pose",
    "read_recording",
]

_OFFERS = {
    "Chunk": "yumi.api.chunks",
    "EgmServer": "yumi.driver.egm_server",
    "abb_degrees": "yumi.api.joint_positions",
    "attach": "yumi.api.attach",
    "connect": "yumi.api.connect",
    "connect_async": "yumi.api.connect",
    "degrees": "yumi.api.joint_positions",
    "in_degrees": "yumi.api.joint_positions",
    "pose": "yumi.api.poses",
    "read_recording": "yumi.recording.tables",
}

add_texts("yumi.texts")


def __getattr__(name: str) -> object:
    """Load what the package offers when it is asked for; ``import yumi`` itself loads nothing."""
    if name == "errors":
        return import_module("abb_protocols.errors")
    if name in _OFFERS:
        return getattr(import_module(_OFFERS[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """What a script needs, for tab completion."""
    return __all__
