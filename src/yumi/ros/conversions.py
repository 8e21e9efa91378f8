"""Messages to values and back; the only place that knows the fields of ROS messages."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from sensor_msgs.msg import JointState

from yumi.control.goals import check_position
from yumi.control.snapshot import Snapshot
from yumi.errors import CommandRefused
from yumi.robot.joints import Joints, Side, joint_names, joints

_NS = 1_000_000_000


def stamp(nanoseconds: int) -> Time:
    """A ROS time stamp."""
    return Time(sec=nanoseconds // _NS, nanosec=nanoseconds % _NS)


def joint_state(names: Iterable[str], position: Iterable[float], velocity: Iterable[float], time_ns: int) -> JointState:
    """Joint states in the order of ``names``; [rad] or [m], [rad/s] or [m/s]. Efforts are not measured."""
    message = JointState()
    message.header.stamp = stamp(time_ns)
    message.name = list(names)
    message.position = list(position)
    message.velocity = list(velocity)
    return message


def goal_of(message: Any, side: Side, base: Joints) -> Joints:
    """The joint goal [rad] in a ``joint_commands`` message; joints it does not name keep their value of ``base``.

    Raises:
        CommandRefused: an unknown or repeated joint, a missing or impossible position.
    """
    names, positions = list(message.name), list(message.position)
    if not names or len(names) != len(positions):
        raise CommandRefused(
            f"Goal refused: it names {len(names)} joints and has {len(positions)} positions; give one each."
        )
    if len(set(names)) != len(names):
        raise CommandRefused(f"Goal refused: a joint is named twice in {', '.join(names)}.")
    known = {name: index for index, name in enumerate(joint_names(side))}
    goal = list(base)
    for name, position in zip(names, positions, strict=True):
        if name not in known:
            raise CommandRefused(
                f"Goal refused: {name!r} is no joint of the {side.word} arm; it has {', '.join(known)}."
            )
        check_position(name, known[name], position)
        goal[known[name]] = position
    return joints(goal)


def egm_status(side: Side, snapshot: Snapshot) -> DiagnosticStatus:
    """The state of one arm's EGM for ``egm_state`` and ``/diagnostics``."""
    level, sentence = _egm_level(snapshot)
    values: Mapping[str, object] = {
        "session": snapshot.session,
        "streaming": snapshot.is_streaming,
        "running": snapshot.is_running,
        "commanded": snapshot.is_commanded,
        "cycles": snapshot.cycles,
        "missed": snapshot.missed,
        "lost": snapshot.lost,
        "late": snapshot.late,
        "stale": snapshot.stale,
        "repeated": snapshot.repeated,
        "malformed": snapshot.malformed,
        "foreign": snapshot.foreign,
        "refused": snapshot.refused,
        "position_limited": snapshot.position_limited,
        "slowed": snapshot.slowed,
        "interruptions": snapshot.interruptions,
        "jitter": snapshot.jitter,
        "worst_jitter": snapshot.worst_jitter,
        "drift_ppm": snapshot.drift_ppm,
        "cycle_time": snapshot.cycle_time,
    }
    pairs = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    return DiagnosticStatus(
        level=level, name=f"yumi: EGM {side.word} arm", message=sentence, hardware_id=side.unit, values=pairs
    )


def _egm_level(snapshot: Snapshot) -> tuple[bytes, str]:
    if snapshot.is_running and not snapshot.is_streaming:
        return DiagnosticStatus.WARN, "running, feedback is interrupted"
    if snapshot.is_running:
        return DiagnosticStatus.OK, "running"
    if snapshot.is_streaming:
        return DiagnosticStatus.WARN, "streaming, the robot does not follow commands"
    if snapshot.foreign and not snapshot.session:
        return DiagnosticStatus.WARN, (
            f"no datagrams from the robot, but {snapshot.foreign} from other addresses; "
            "check robot.address and the controller's UDPUC device"
        )
    return DiagnosticStatus.STALE, "no datagrams from the robot; call start_egm"
