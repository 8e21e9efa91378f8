"""The codec of the control loop: joints of a seven-axis arm in and out, by the core.

:mod:`abb_protocols.egm.codec` has the whole messages of any robot, for both ends.
"""

from __future__ import annotations

from ctypes import create_string_buffer
from typing import NamedTuple

from abb_protocols.catalogue import Message, message
from abb_protocols.egm import egm_pb2 as pb
from abb_protocols.egm.codec import LARGEST_DATAGRAM, MciState, MotorState, RapidState, wrong_axes
from abb_protocols.errors import ProtocolError
from abb_protocols.robot.joints import ZERO_JOINTS, Joints
from yumi.core.library import COMMAND_STRUCT, REPORT_STRUCT, UNREADABLE_DATAGRAM_STRUCT, load

_LARGEST_REFERENCE = 160
"""Our own datagrams are shorter [bytes]."""

_UINT32 = 2**32
_DATA = pb.EgmHeader.MSGTYPE_DATA
_PARTS = {2: "feedBack", 3: "planned", 4: "motorState", 5: "mciState", 8: "rapidExecState"}


class JointReport(NamedTuple):
    """What the control loop reads of a robot's message; a tuple, since that is made fastest.

    Attributes:
        seqno: counts datagrams; a session starts at 0.
        measured: measured joint positions, chain order [rad], (7,).
        planned: reference joint positions, chain order [rad], (7,).
        measured_time: when ``measured`` held, controller clock of unknown epoch [s].
        motors: state of the motors.
        mci: state of the motion correction interface.
        rapid: state of the RAPID execution.
    """

    seqno: int
    measured: Joints
    planned: Joints
    measured_time: float
    motors: MotorState
    mci: MciState
    rapid: RapidState


class JointCodec:
    """Our end of a seven-axis arm in joint mode: what the core does with each datagram of the control loop."""

    def __init__(self) -> None:
        self._library = load()
        self._report, self._unreadable = (
            create_string_buffer(REPORT_STRUCT.size),
            create_string_buffer(UNREADABLE_DATAGRAM_STRUCT.size),
        )
        self._datagram = create_string_buffer(_LARGEST_REFERENCE)

    def decode(self, datagram: bytes) -> JointReport:
        """The joints and the state in the robot's message.

        Raises:
            ProtocolError: the datagram is not a complete message of a seven-axis robot.
        """
        if not self._library.codec_decode(datagram, len(datagram), self._report, self._unreadable):
            raise ProtocolError(_unreadable(len(datagram), *UNREADABLE_DATAGRAM_STRUCT.unpack(self._unreadable.raw)))
        seqno, *values, time, motors, mci, rapid = REPORT_STRUCT.unpack(self._report.raw)
        measured, planned = (tuple(each) for each in (values[:7], values[7:]))
        states = MotorState(motors), MciState(mci), RapidState(rapid)
        return JointReport(seqno, measured, planned, time, *states)

    def encode_joints(self, seqno: int, position: Joints, velocity: Joints | None) -> bytes:
        """The datagram that gives the arm its position [rad] and velocity [rad/s].

        Raises:
            ValueError: a value is not finite: a reference with NaN crashes the controller (reference/egm.md §4.5).
        """
        command = COMMAND_STRUCT.pack(*position, *(velocity or ZERO_JOINTS), velocity is not None)
        size = self._library.codec_encode(seqno % _UINT32, command, self._datagram)
        if not size:
            raise not_finite(position, velocity or ZERO_JOINTS)
        return self._datagram.raw[:size]


def not_finite(position: Joints, velocity: Joints) -> ValueError:
    """A reference that is not sent."""
    return ValueError(f"a reference needs seven finite values, got {position} and {velocity}")


def _unreadable(size: int, why: int, part: int, number: int, external: int, *degrees: float) -> Message:
    """Why the core does not read a datagram; the reasons by number as ``Unreadable`` in ``core/egm_codec.hpp``."""
    name = _PARTS.get(part, "")
    return (
        message("datagram_too_long", size=size, most=LARGEST_DATAGRAM),
        message("datagram_not_decoded", size=size, error="truncated or not protobuf"),
        message("datagram_of_wrong_type", type=number, expected=_DATA),
        message("datagram_without_time"),
        message("datagram_without_state", part=name),
        wrong_axes(name, number, external, 7),
        message(
            "datagram_joint_implausible",
            part=name,
            joints_deg=tuple(map(str, degrees[:6])),
            external_deg=(str(degrees[6]),),
        ),
    )[why - 1]
