"""Messages of ROS 2 for recordings, as CDR and without ROS: joint states, frames and the robot's description.

A schema has the message's definition with the definitions that it consists of, as MCAP's encoding ``ros2msg`` demands.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

from abb_protocols.robot.joints import Pose

_SEPARATOR = "\n" + 80 * "=" + "\nMSG: "
_HEADER = (
    f"{_SEPARATOR}std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id"
    f"{_SEPARATOR}builtin_interfaces/Time\nint32 sec\nuint32 nanosec"
)

JOINT_STATE_MESSAGE, TF_MESSAGE, STRING_MESSAGE = (
    "sensor_msgs/msg/JointState",
    "tf2_msgs/msg/TFMessage",
    "std_msgs/msg/String",
)

MESSAGE_DEFINITIONS = {
    JOINT_STATE_MESSAGE: (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort" + _HEADER
    ),
    TF_MESSAGE: (
        "geometry_msgs/TransformStamped[] transforms"
        f"{_SEPARATOR}geometry_msgs/TransformStamped\n"
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform"
        f"{_SEPARATOR}geometry_msgs/Transform\ngeometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation"
        f"{_SEPARATOR}geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z"
        f"{_SEPARATOR}geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w" + _HEADER
    ),
    STRING_MESSAGE: "string data",
}
"""Schemas of the messages by their type."""

_CDR = b"\x00\x01\x00\x00"  # little-endian XCDR1; offsets of what follows count from its end


class RecordedTransform(NamedTuple):
    """A frame in its parent, at a time of day [ns since 1970]."""

    nanoseconds: int
    parent: str
    name: str
    pose: Pose


def _with_text(content: bytes, text: str) -> bytes:
    """``content`` with a string behind it."""
    data = text.encode() + b"\0"
    return content + b"\0" * (-len(content) % 4) + struct.pack("<I", len(data)) + data


@lru_cache(maxsize=16)  # the same few in thousands of messages
def joint_names_part(names: tuple[str, ...]) -> bytes:
    """What follows the time stamp in each JointState of these joints: an empty frame, the count, the names."""
    content = _with_text(b"", "") + b"\0" * 3
    content += struct.pack("<I", len(names))
    for name in names:
        content = _with_text(content, name)
    return content + b"\0" * (-len(content) % 4)


def joint_state_message(names: bytes, nanoseconds: int, position: Sequence[float], velocity: Sequence[float]) -> bytes:
    """A sensor_msgs/msg/JointState.

    Args:
        names: of :func:`joint_names_part`.
        nanoseconds: when the joints were there [ns since 1970].
        position: of the joints [rad], [m].
        velocity: of the joints [rad/s], [m/s].
    """
    content = struct.pack("<iI", *divmod(nanoseconds, 10**9)) + names
    for values in (position, velocity, ()):
        content += struct.pack("<I", len(values))
        if values:
            content += b"\0" * (-len(content) % 8) + struct.pack(f"<{len(values)}d", *values)
    return _CDR + content


def frames_message(transforms: Sequence[RecordedTransform]) -> bytes:
    """A tf2_msgs/msg/TFMessage."""
    content = bytearray(struct.pack("<I", len(transforms)))
    for time, parent, name, pose in transforms:
        content += struct.pack("<iI", *divmod(time, 10**9))
        content += _frame_names(parent, name)
        content += b"\0" * (-len(content) % 8)
        w, x, y, z = pose.orientation  # a quaternion of ROS ends with w
        content += struct.pack("<7d", *pose.position, x, y, z, w)
    return _CDR + bytes(content)


@lru_cache(maxsize=64)
def _frame_names(parent: str, name: str) -> bytes:
    """Both names, to stand at a multiple of four."""
    return _with_text(_with_text(b"", parent), name)


def text_message(text: str) -> bytes:
    """A std_msgs/msg/String."""
    return _CDR + _with_text(b"", text)
