"""Messages to values and back; the only place that knows the fields of ROS messages."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from sensor_msgs.msg import JointState

from yumi.control.snapshot import CAUSES, Problem, Snapshot
from yumi.robot.joints import Side

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
        "implausible": snapshot.implausible,
        "problem": snapshot.problem.name.lower(),
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
    if snapshot.problem is not Problem.NONE:
        return DiagnosticStatus.ERROR, CAUSES[snapshot.problem]
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
