"""The snapshot: everything about one arm that the world outside the fast line may know, as numbers in a mailbox."""

from __future__ import annotations

from dataclasses import dataclass
from math import isnan, nan

from yumi.control.mailbox import Mailbox, Values
from yumi.robot.joints import JOINT_COUNT, Joints, joints
from yumi.robot.values import ZERO

_SCALARS = 12
SNAPSHOT_SIZE = _SCALARS + 4 * JOINT_COUNT
"""Numbers in a snapshot mailbox."""


@dataclass(frozen=True, slots=True)
class Snapshot:
    """One arm after its last cycle.

    Attributes:
        time: when it was made, monotonic clock [s].
        session: EGM session, 0 before the first.
        is_streaming: whether the robot's datagrams arrive.
        is_running: whether the robot follows our commands.
        is_commanded: whether a controller that commands the arm is active.
        position: measured positions [rad].
        velocity: measured velocities [rad/s].
        admitted: the command sent last [rad].
        reference: where the active controller is going [rad]; None when no controller commands.
        cycles: datagrams answered.
        missed: datagrams the robot sent that got no answer of their own.
        stale: old or repeated datagrams left aside.
        malformed: datagrams that could not be read.
        refused: commands with a value that is no finite number.
        position_limited: commands cut at a joint's range.
        velocity_limited: commands slowed to a joint's speed.
    """

    time: float = 0.0
    session: int = 0
    is_streaming: bool = False
    is_running: bool = False
    is_commanded: bool = False
    position: Joints = ZERO
    velocity: Joints = ZERO
    admitted: Joints = ZERO
    reference: Joints | None = None
    cycles: int = 0
    missed: int = 0
    stale: int = 0
    malformed: int = 0
    refused: int = 0
    position_limited: int = 0
    velocity_limited: int = 0


_NO_REFERENCE: Joints = (nan, nan, nan, nan, nan, nan, nan)


def put_snapshot(box: Mailbox, snapshot: Snapshot) -> None:
    """Replace what is known of the arm."""
    box.put(
        (
            snapshot.time,
            snapshot.session,
            snapshot.is_streaming,
            snapshot.is_running,
            snapshot.is_commanded,
            snapshot.cycles,
            snapshot.missed,
            snapshot.stale,
            snapshot.malformed,
            snapshot.refused,
            snapshot.position_limited,
            snapshot.velocity_limited,
            *snapshot.position,
            *snapshot.velocity,
            *snapshot.admitted,
            *(snapshot.reference or _NO_REFERENCE),
        )
    )


def peek_snapshot(box: Mailbox) -> Snapshot:
    """What is known of the arm; the empty snapshot while nothing is."""
    letter = box.peek()
    return Snapshot() if letter is None else _from_values(letter[1])


def _from_values(values: Values) -> Snapshot:
    time, session, streaming, running, commanded, *counts = values[:_SCALARS]
    cycles, missed, stale, malformed, refused, position_limited, velocity_limited = (int(count) for count in counts)
    position, velocity, admitted, reference = (
        joints(values[start : start + JOINT_COUNT]) for start in range(_SCALARS, SNAPSHOT_SIZE, JOINT_COUNT)
    )
    return Snapshot(
        time=time,
        session=int(session),
        is_streaming=bool(streaming),
        is_running=bool(running),
        is_commanded=bool(commanded),
        position=position,
        velocity=velocity,
        admitted=admitted,
        reference=None if isnan(reference[0]) else reference,
        cycles=cycles,
        missed=missed,
        stale=stale,
        malformed=malformed,
        refused=refused,
        position_limited=position_limited,
        velocity_limited=velocity_limited,
    )
