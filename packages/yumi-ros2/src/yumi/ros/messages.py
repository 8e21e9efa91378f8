"""ROS messages to values and back: positions, speeds, controllers, activity, time stamps, the robot's state; their QoS.

Messages of ``controller_manager_msgs`` and ``control_msgs`` differ between installations of one ROS distribution; only
the fields that the installed type has are filled.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime, timezone
from enum import Enum
from math import degrees, isfinite
from typing import Any

from builtin_interfaces.msg import Time
from control_msgs.msg import InterfaceValue
from controller_manager_msgs.msg import ControllerState, HardwareComponentState, HardwareInterface
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from lifecycle_msgs.msg import State as LifecycleState
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from yumi_interfaces.msg import ControllerEvent
from yumi_interfaces.msg import RobotState as RobotStateMessage

from abb_protocols.catalogue import clause, remedy_of
from abb_protocols.catalogue import message as said  # a message here is one of ROS
from abb_protocols.errors import CommandRefused, YumiError
from abb_protocols.robot.description import Mass
from abb_protocols.robot.joints import (
    CYCLE,
    JOINT_COUNT,
    YUMI_LIMITS,
    ZERO_JOINTS,
    Joints,
    Pose,
    Side,
    joint_names,
    joints,
)
from abb_protocols.rws.operations.event_log import RwsEvent
from abb_protocols.rws.values import EventType
from abb_runtime.clock import Clock
from yumi.control.controller import State
from yumi.control.controller_info import ControllerInfo, HardwareInfo, InterfaceInfo
from yumi.control.goals import UNKNOWN_JOINTS, check_position
from yumi.control.hand_over import Commanding
from yumi.control.shared_state import ARM_PROBLEM_CODES, ArmProblem, Snapshot
from yumi.driver.robot_state import RobotMode, RobotState
from yumi.driver.state_machine import MachineState
from yumi.driver.stops import explain
from yumi.ros.topic_refusals import command_refused
from yumi.texts.events import KNOWN_NUMBERS

LATCHED_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""A late subscriber gets the newest message."""

SERVICES_QOS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
"""So many calls may wait for their answer; of more than 10, ROS 2's default, it would lose some without a word."""

RATE = round(1.0 / CYCLE)
"""``update_rate`` [Hz]: the robot's own, 4.032 ms a cycle."""

_NS = 1_000_000_000


def stamp(nanoseconds: int) -> Time:
    """A ROS time stamp."""
    return Time(sec=nanoseconds // _NS, nanosec=nanoseconds % _NS)


_SLEW = 1e-3  # the system's clock is slewed by at most half of this
_CLOCK_SET_NS = 50_000_000


class Stamps:
    """Turns times of the machine's monotonic clock into ROS time, without jitter when the reading is interrupted.

    Reading two clocks one after the other can only make their difference too large, so the smallest one counts; it may
    grow as fast as clocks are slewed, and is taken anew when the ROS clock is set.

    Args:
        ros_now: the ROS time [ns].
        now: the monotonic time [s].
    """

    def __init__(self, ros_now: Callable[[], int], now: Callable[[], float]) -> None:
        self._ros_now = ros_now
        self._now = now
        self._difference: int | None = None
        self._read = 0.0

    @classmethod
    def of(cls, node: Any, clock: Clock) -> Stamps:
        """Those of a node's clock, for times of the machine's clock."""
        ros_clock = node.get_clock()
        return cls(lambda: int(ros_clock.now().nanoseconds), clock.now)

    def at(self, time: float) -> int:
        """The ROS time [ns] of the monotonic ``time`` [s]."""
        now = self._now()
        difference = self._ros_now() - int(now * 1e9)
        last = difference if self._difference is None else self._difference
        if abs(difference - last) < _CLOCK_SET_NS:
            difference = min(difference, last + int((now - self._read) * _SLEW * 1e9))
        self._difference, self._read = difference, now
        return int(time * 1e9) + difference


def joint_state(
    names: Iterable[str], position: Iterable[float], velocity: Iterable[float], time_ns: int, frame: str = ""
) -> JointState:
    """Joint states in the order of ``names``; [rad] or [m], [rad/s] or [m/s]. Efforts are not measured."""
    message = JointState()
    message.header.stamp = stamp(time_ns)
    message.header.frame_id = frame
    message.name = list(names)
    message.position = list(position)
    message.velocity = list(velocity)
    return message


_COUNTERS = (
    *("cycles", "missed", "lost", "late", "stale", "repeated", "malformed", "foreign", "refused"),
    *("position_limited", "slowed", "kept_apart", "interruptions", "implausible", "unanswered"),
)
"""Of an arm, in the values of ``egm_state``."""


def egm_status(
    side: Side,
    snapshot: Snapshot,
    commanding: Commanding = Commanding(),  # noqa: B008 - it is frozen
    *,
    is_desired: bool = False,
) -> DiagnosticStatus:
    """The state of one arm's EGM for ``egm_state`` and ``/diagnostics``, and who commands the arm.

    That EGM is off is OK unless it ``is_desired``.
    """
    level, sentence = DiagnosticStatus.OK, "off, no datagrams from the robot; start_egm starts EGM"
    if snapshot.problem is not ArmProblem.NONE:
        level, sentence = DiagnosticStatus.ERROR, str(said(ARM_PROBLEM_CODES[snapshot.problem], arm=side.word))
    elif snapshot.is_running and not snapshot.is_streaming:
        level, sentence = DiagnosticStatus.WARN, "running, feedback is interrupted"
    elif snapshot.is_running:
        level, sentence = DiagnosticStatus.OK, "running"
    elif snapshot.is_streaming:
        level, sentence = DiagnosticStatus.WARN, "streaming, the robot does not follow commands"
    elif is_desired:
        level, sentence = DiagnosticStatus.WARN, "no datagrams from the robot though EGM was started; call recover"
    elif snapshot.wire.foreign and not snapshot.session:
        level = DiagnosticStatus.WARN
        sentence = (
            f"no datagrams from the robot, but {snapshot.wire.foreign} from other addresses; "
            "check robot.address and the controller's UDPUC device"
        )
    counters = {**snapshot._asdict(), **snapshot.wire._asdict(), **snapshot.limiter._asdict()}
    values: dict[str, object] = {
        "session": snapshot.session,
        "streaming": snapshot.is_streaming,
        "running": snapshot.is_running,
        "commanded": snapshot.is_commanded,
        "commander": commanding.who.value,
        "commander_client": commanding.name,
        "commander_since": f"{commanding.since:.3f}",  # on the monotonic clock
        "reserved_for_person": commanding.is_reserved,
        "take_over_refused": "" if commanding.refused is None else str(commanding.refused),
        **{name: counters[name] for name in _COUNTERS},
        "limited_by": snapshot.limited_by,
        "problem": snapshot.problem.name.lower(),
        **{name: counters[name] for name in ("jitter", "worst_jitter", "drift_ppm", "cycle_time")},
    }
    pairs = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    return DiagnosticStatus(
        level=level, name=f"yumi: EGM {side.word} arm", message=sentence, hardware_id=side.unit, values=pairs
    )


_DEGREES_ABOVE = 3.0  # times what a joint reaches [rad/s]: so far from it a speed was hardly meant in radians


def goal_of_ros_message(message: Any, side: Side, base: Joints) -> Joints:
    """The joint goal [rad] in a ``joint_commands`` message; joints it does not name keep their value of ``base``.

    Raises:
        CommandRefused: an unknown or repeated joint, a missing or impossible position or velocity.
    """
    indices = _indices(message.name, message.position, side, "Goal", "position")
    goal = list(base)
    for index, position in zip(indices, message.position, strict=True):
        check_position(joint_names(side)[index], index, position)
        goal[index] = position
    return joints(goal)


def goal_speeds_of(message: Any, side: Side) -> Joints:
    """How fast the goal of a ``joint_commands`` message itself moves [rad/s]; NaN where it does not say so.

    Raises:
        CommandRefused: velocities that do not go with the names, or are impossible.
    """
    if not len(message.velocity):
        return UNKNOWN_JOINTS
    return joints(_by_name(message.name, message.velocity, side, "Goal", UNKNOWN_JOINTS))


def velocities_of(message: Any, side: Side) -> Joints:
    """The speeds [rad/s] in a ``joint_velocity_commands`` message; joints it does not name stop.

    Raises:
        CommandRefused: an unknown or repeated joint, a missing or impossible velocity.
    """
    return joints(_by_name(message.name, message.velocity, side, "Speed", ZERO_JOINTS))


def positions_of(message: Any, side: Side) -> Joints:
    """The positions [rad] in a Float64MultiArray, one for each joint.

    Raises:
        CommandRefused: another number of them, or an impossible one.
    """
    return _by_index(message, side, "Goal", check_position)


def speeds_of(message: Any, side: Side) -> Joints:
    """The speeds [rad/s] in a Float64MultiArray, one for each joint.

    Raises:
        CommandRefused: another number of them, or an impossible one.
    """
    return _by_index(message, side, "Speed", lambda name, index, value: _check_velocity(name, index, value, "Speed"))


def _by_index(message: Any, side: Side, noun: str, check: Callable[[str, int, float], None]) -> Joints:
    if len(message.data) != JOINT_COUNT:
        raise command_refused(noun, said("values_wrong_count", count=len(message.data), joints=JOINT_COUNT))
    for index, (name, value) in enumerate(zip(joint_names(side), message.data, strict=True)):
        check(name, index, value)
    return joints(message.data)


def _by_name(names: Sequence[str], values: Sequence[float], side: Side, noun: str, base: Joints) -> list[float]:
    indices = _indices(names, values, side, noun, "velocity")
    found = list(base)
    for index, velocity in zip(indices, values, strict=True):
        _check_velocity(joint_names(side)[index], index, velocity, noun)
        found[index] = velocity
    return found


def _indices(names: Sequence[str], values: Sequence[float], side: Side, noun: str, what: str) -> list[int]:
    """Places of the named joints in chain order."""
    if not names or len(names) != len(values):
        raise command_refused(noun, said("names_and_values_differ", names=len(names), what=what, values=len(values)))
    known = {name: index for index, name in enumerate(joint_names(side))}
    for name in names:
        if name not in known:
            raise command_refused(noun, said("no_joint_of_arm", name=name, arm=side.word, joints=tuple(known)))
    if len(set(names)) != len(names):
        twice = next(name for name in known if names.count(name) > 1)
        raise command_refused(noun, said("joint_named_twice", name=twice))
    return [known[name] for name in names]


def _check_velocity(name: str, index: int, velocity: float, noun: str) -> None:
    if not isfinite(velocity):
        raise command_refused(noun, said("speed_not_finite", name=name, value=velocity))
    top = YUMI_LIMITS.velocity[index]
    if abs(velocity) <= top:
        return
    looks_like_degrees = _DEGREES_ABOVE * top < abs(velocity) <= degrees(top)
    code = "speed_looks_like_degrees" if looks_like_degrees else "speed_too_high"
    raise command_refused(noun, said(code, name=name, value=velocity, highest=top))


try:
    from controller_manager_msgs.msg import ControllerManagerActivity, NamedLifecycleState
except ImportError:  # installations from before April 2025
    ControllerManagerActivity = NamedLifecycleState = None

try:
    from control_msgs.msg import DynamicInterfaceGroupValues
except ImportError:  # installations from before March 2025
    DynamicInterfaceGroupValues = None

GPIO_STATES: Any = DynamicInterfaceGroupValues
"""The type of ``~/gpio_states``, as upstream's gpio_controllers have it; None where the installed package is older."""

ACTIVITY: Any = ControllerManagerActivity
"""The type of ``~/activity``; None where the installed package is older."""

_PLUGIN = "yumi_ros2/EgmSystem"
"""What the tools show as the plug-in of an arm's hardware component."""

_IDS = {
    State.UNCONFIGURED: LifecycleState.PRIMARY_STATE_UNCONFIGURED,
    State.INACTIVE: LifecycleState.PRIMARY_STATE_INACTIVE,
    State.ACTIVE: LifecycleState.PRIMARY_STATE_ACTIVE,
    State.FINALIZED: LifecycleState.PRIMARY_STATE_FINALIZED,
}


def filled_message(message: Any, /, **values: object) -> Any:
    """``message`` with ``values`` in the fields that the installed type has; some came within one ROS distribution."""
    for name, value in values.items():
        if hasattr(message, name):
            setattr(message, name, value)
    return message


def lifecycle_state(state: State) -> LifecycleState:
    """Id and label, since some tools compare the one and some the other."""
    return LifecycleState(id=_IDS[state], label=state.value)


def lifecycle_of_ros_message(message: Any) -> State:
    """The primary state that ``message`` names by its id, or by its label where the id is 0.

    Raises:
        CommandRefused: it names none.
    """
    for state, number in _IDS.items():
        if message.id == number or (message.id == 0 and message.label == state.value):
            return state
    choices = ", ".join(f"{number} {state.value}" for state, number in _IDS.items())
    raise CommandRefused(said("state_not_primary", number=message.id, label=message.label, choices=choices))


def how_to_activate(namespace: str, side: Side, name: str, instead_of: Sequence[str] = ()) -> str:
    """The commands that activate a controller, of this package and of ROS.

    Args:
        namespace: of the arm's nodes, such as ``/r``.
        side: the arm.
        name: the controller.
        instead_of: active controllers that claim what it needs; ``yumi switch`` finds them itself.
    """
    options = f"--activate {name}" + (f" --deactivate {' '.join(instead_of)}" if instead_of else "")
    manager = f"{namespace.rstrip('/')}/controller_manager"
    return f"yumi switch {side.word} {name} (in ROS: ros2 control switch_controllers -c {manager} {options})"


def controller_state(info: ControllerInfo) -> ControllerState:
    """One controller in ``list_controllers``; required interfaces only from configuring on, as upstream."""
    is_configured = info.state in {State.INACTIVE, State.ACTIVE}
    return filled_message(
        ControllerState(),
        name=info.name,
        state=info.state.value,
        type=info.kind,
        is_async=False,
        update_rate=RATE,
        claimed_interfaces=list(info.claimed),
        required_command_interfaces=list(info.required) if is_configured else [],
        required_state_interfaces=list(info.required_state) if is_configured else [],
        is_chainable=False,
        is_chained=False,
    )


def hardware_state(info: HardwareInfo) -> HardwareComponentState:
    """An arm in ``list_hardware_components``."""
    return filled_message(
        HardwareComponentState(),
        name=info.name,
        type="system",
        is_async=False,
        rw_rate=RATE,
        plugin_name=_PLUGIN,
        state=lifecycle_state(info.state),
        command_interfaces=hardware_interfaces(info.command_interfaces),
        state_interfaces=hardware_interfaces(info.state_interfaces),
    )


def hardware_interfaces(infos: Iterable[InterfaceInfo]) -> list[HardwareInterface]:
    """Command or state interfaces; all are doubles."""
    return [
        filled_message(
            HardwareInterface(),
            name=info.name,
            data_type="double",
            is_available=info.is_available,
            is_claimed=info.is_claimed,
        )
        for info in infos
    ]


def activity(controllers: Iterable[ControllerInfo], hardware: HardwareInfo, time_ns: int) -> ControllerManagerActivity:
    """Who is in which state; only where the installed package has the type."""
    message = ControllerManagerActivity()
    message.header.stamp = stamp(time_ns)
    message.controllers, message.hardware_components = (
        [NamedLifecycleState(name=info.name, state=lifecycle_state(info.state)) for info in infos]
        for infos in (controllers, (hardware,))
    )
    return message


def seconds(duration: Any, name: str) -> float:
    """A builtin_interfaces/Duration [s]; as :func:`nanoseconds`."""
    return nanoseconds(duration, name) / _NS


def nanoseconds(time: Any, name: str) -> int:
    """A builtin_interfaces/Duration or Time [ns].

    Raises:
        CommandRefused: it has more nanoseconds than a second, and nothing says what was meant; the sentence begins with
            ``name``.
    """
    if time.nanosec >= _NS:
        raise CommandRefused(said("nanoseconds_out_of_range", name=name, nanoseconds=time.nanosec))
    return int(time.sec) * _NS + int(time.nanosec)


_TIME = "%Y-%m-%d T %H:%M:%S"  # as the controller prints it
_TYPES = {EventType.INFORMATION: "information", EventType.WARNING: "warning", EventType.ERROR: "error"}
_SIDES = {side.word: side for side in Side}
_PERCENT = 100
_LAST_SECOND = 2**31 - 1
_LARGEST_CODE = 2**32 - 1


def robot_state(state: RobotState, time_ns: int, frame: str = "") -> RobotStateMessage:
    """The state as a message; what is not known is empty. ``frame`` is that of the robot's base."""
    return RobotStateMessage(
        header=Header(stamp=stamp(time_ns), frame_id=frame),
        is_connected=state.is_connected,
        is_ready=not state.reasons,
        reason=state.reason,
        reason_codes=[each.code for each in state.reasons],
        cause=state.cause,
        cause_codes=[each.code for each in state.causes],
        stop=state.stop,
        speed_scale=state.speed_scale,
        operating_mode=_word(state.operating_mode),
        controller_state=_word(state.controller_state),
        rapid_execution=_word(state.execution),
        right_state_machine=_machine(state, Side.RIGHT),
        left_state_machine=_machine(state, Side.LEFT),
        right_egm=state.egm[Side.RIGHT],
        left_egm=state.egm[Side.LEFT],
        speed_ratio=min(max(state.speed_ratio or 0, 0), _PERCENT),
        allowed_collisions=state.allowed_collisions,
        limited_by=state.limited_by,
        last_event=_controller_event(state.last_event),
    )


def _controller_event(event: RwsEvent | None) -> ControllerEvent:
    """A message of the event log with our words; the number 0 where there is none."""
    if event is None:
        return ControllerEvent()
    explained = explain(event)
    is_known = event.code in KNOWN_NUMBERS
    try:  # the controller's local time, without a zone
        local = datetime.strptime(event.time, _TIME).replace(tzinfo=timezone.utc)
        seconds = min(max(int(local.timestamp()), 0), _LAST_SECOND)
    except ValueError:
        seconds = 0
    return ControllerEvent(
        number=min(max(event.code, 0), _LARGEST_CODE),
        type=_TYPES[event.type],
        title=event.title,
        stamp=Time(sec=seconds),
        cause=clause(explained) if is_known else "",
        remedy=remedy_of(explained) if is_known else "",
    )


def robot_status(state: RobotState) -> DiagnosticStatus:
    """The state for ``/diagnostics``: an error without a connection, a warning while it is not ready."""
    event, level = _controller_event(state.last_event), DiagnosticStatus.OK
    if state.reasons:
        level = DiagnosticStatus.WARN if state.is_connected else DiagnosticStatus.ERROR
    values: Mapping[str, str] = {
        "operating_mode": _word(state.operating_mode),
        "motors": _word(state.controller_state),
        "rapid": _word(state.execution),
        **{f"state_machine_{side.word}": _machine(state, side) for side in Side},
        **{f"egm_{side.word}": state.egm[side] for side in Side},
        "speed_ratio": "" if state.speed_ratio is None else f"{state.speed_ratio} %",
        "cause": state.cause,
        "stop": state.stop,
        "speed_scale": f"{state.speed_scale:g}",
        "event": f"{event.number} {event.title}" if event.number else "",
        "event_cause": event.cause,
        "event_remedy": event.remedy,
    }
    return DiagnosticStatus(
        level=level,
        name="yumi: robot",
        message=f"not ready: {state.reason}" if state.reasons else "ready",
        hardware_id="IRC5",
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )


def gpio_states(values: Mapping[str, float], time_ns: int, frame: str = "") -> Any:
    """I/O signals by name as one group, ``controller``; only where the installed package has the type."""
    return GPIO_STATES(
        header=Header(stamp=stamp(time_ns), frame_id=frame),
        interface_groups=["controller"],
        interface_values=[InterfaceValue(interface_names=list(values), values=list(values.values()))],
    )


def mass_of(message: Any) -> Mass:
    """The body in a geometry_msgs/Inertia [kg, m, kg m²]."""
    inertia = (message.ixx, message.ixy, message.ixz, message.iyy, message.iyz, message.izz)
    return Mass(message.m, (message.com.x, message.com.y, message.com.z), inertia)


def say_why(answer: Any, error: YumiError) -> None:
    """Why a request was refused or failed, into ``message`` and, where the type has them, ``code`` and ``stop``."""
    answer.message = str(error)
    if hasattr(answer, "code"):  # the types of std_srvs have none
        answer.code = error.said.code
    if hasattr(answer, "stop"):
        answer.stop = getattr(error, "stop", "")


def pose_of_ros_message(message: Any) -> Pose:
    """The pose in a geometry_msgs/Pose [m]."""
    place, turn = message.position, message.orientation
    return Pose((place.x, place.y, place.z), (turn.w, turn.x, turn.y, turn.z))


def fill_pose(position: Any, rotation: Any, pose: Pose) -> None:
    """Write a pose into the two fields of a message that have it."""
    position.x, position.y, position.z = pose.position
    rotation.w, rotation.x, rotation.y, rotation.z = pose.orientation


def side_of_ros_message(arm: str) -> Side:
    """The arm that a request names.

    Raises:
        CommandRefused: it names none.
    """
    if arm not in _SIDES:
        raise CommandRefused(said("arm_unknown", arm=arm))
    return _SIDES[arm]


def mode_of(name: str) -> RobotMode:
    """The mode that a goal names.

    Raises:
        CommandRefused: it names none.
    """
    try:
        return RobotMode(name)
    except ValueError as error:
        raise CommandRefused(
            said("mode_not_known", mode=name, modes=tuple(mode.value for mode in RobotMode))
        ) from error


def _machine(state: RobotState, side: Side) -> str:
    machine: MachineState | None = state.machines[side]
    return "" if machine is None else machine.name


def _word(value: Enum | None) -> str:
    return "" if value is None else str(value.value)
