"""The wiring plan: which objects, threads and processes make up the driver.

::

    yumi up          process 1     RWS client, robot manager, grippers, ROS nodes
                                   threads: answers (five), streams, timers, slow-timers-r and -l, signal-timers,
                                            joint-states-r, joint-states-l, grippers, robot-monitor, watchdog,
                                            control-events, automatic-recovery (recovery.automatic), all of
                                            them supervised (process/supervision.py); endpoint, endpoint-work (16 at
                                            most);
                                            web-socket (opened again by who listens), flight-records and
                                            flight-records-after (when something stops),
                                            full-recorder (--record; a broken file is not begun again),
                                            end-in-time, forced-end
                     process 2     the control process: the cycles of both arms, one thread

The controllers an arm starts with: loaded, given their parameters and led to their initial states.

An arm behind EGM: datagrams from a link become states, commands become datagrams; and a perfect arm for tests.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from ipaddress import ip_address
from math import radians
from typing import NamedTuple, Protocol

from yumi.clock import Clock, SystemClock
from yumi.control.collisions import CollisionLimiter
from yumi.control.controller import ENCODE, RECEIVE, SEND, Controller, StageClock, find_parameter
from yumi.control.controller_manager import ControllerManager
from yumi.control.controllers.cartesian import CartesianController
from yumi.control.controllers.joint_goal import JointGoalController
from yumi.control.controllers.joint_position import (
    FORWARDERS,
    ForwardCommandController,
    JointPositionController,
    JointStateBroadcaster,
    JointVelocityController,
)
from yumi.control.controllers.joint_trajectory import DualArmTrajectoryController, JointTrajectoryController
from yumi.control.cycle import FlightRecorder, WireCounters
from yumi.control.limiter import FULL, Limiter, SpeedScale
from yumi.control.loop import ArmLoop
from yumi.control.motion import EGM_GAIN
from yumi.control.shared_state import Event, read_snapshot
from yumi.control.tool_path import ToolLimits
from yumi.driver.bringup import Bringup, EgmAddress
from yumi.driver.control_process import ArmBuffers, ConnectedArm, ControlProcess
from yumi.driver.gripper import Gripper, GripperRoutines, GripperSignals
from yumi.driver.readiness import StopLog
from yumi.driver.robot_manager import RobotManager
from yumi.driver.settings import MANAGER_SETTINGS, CollisionSettings, ControllerSettings, InitialState, Settings
from yumi.driver.state_machine import FIRST_CONTACT, SpeedSetting
from yumi.egm.codec import JointCodec, JointReport, MciState, MotorState, RapidState, RobotMessage
from yumi.egm.session import Counted, Message, SensorSession
from yumi.egm.udp import UdpServer, address_towards, resolve
from yumi.errors import CommandRefused, SettingsError, SwitchFailed
from yumi.process.supervision import SingleInstance
from yumi.robot.description import SERVO_GRIPPERS
from yumi.robot.gripper import GripperModules
from yumi.robot.joints import (
    CYCLE,
    YUMI_LIMITS,
    ZERO,
    ArmCommand,
    ArmState,
    JointLimits,
    Joints,
    Side,
    change_rate,
    joint_names,
    set_prefix,
)
from yumi.rws.client import RwsClient

LONGEST_PERIOD = 0.100
"""The robot's clock is not believed beyond this [s]."""


PUNCTUAL = 0.5 * CYCLE, 1.25 * CYCLE
"""Times between two datagrams at which nothing else can wait behind the second [s]."""

_ON, _RUNNING, _STOPPED = MotorState.ON, MciState.RUNNING, RapidState.STOPPED  # the enumerations are slow to look into


class DatagramLink(Protocol):
    """A socket that talks to one robot, or anything that behaves like one."""

    @property
    def foreign(self) -> int:
        """How many datagrams came from elsewhere and were left aside."""

    @property
    def is_pinned(self) -> bool:
        """Whether only one sender is heard."""

    def pin(self) -> None:
        """From now on hear only the sender of what was handed out last."""

    def release(self) -> None:
        """From now on hear every sender again."""

    def receive_next(self) -> bytes | None:
        """The oldest datagram that waits, if any; never waits."""

    def receive(self) -> Sequence[bytes]:
        """All datagrams of one sender that wait, oldest first; never waits."""

    def send(self, datagram: bytes) -> None:
        """Answer the sender of what was handed out last."""


def accept_from(
    link: DatagramLink, session: SensorSession[Message], datagrams: Sequence[bytes], now: float
) -> Message | None:
    """Take what has arrived; the sender of what begins a session is the only one heard until the session ends."""
    while datagrams:
        message = session.accept(datagrams, now)
        if link.is_pinned:
            return message
        if message is not None:
            link.pin()
            return message
        datagrams = link.receive()
    return None


class EgmArm:
    """One seven-axis arm guided by EGM.

    Args:
        link: where its datagrams come from.
        session: its conversation.
        stages: what notes where a cycle's time goes.
        keep: given the datagram of each cycle after it was answered, for who wants to know what else is in it.
    """

    def __init__(
        self,
        link: DatagramLink,
        session: SensorSession[JointReport],
        stages: StageClock | None = None,
        keep: Callable[[bytes], None] = lambda datagram: None,
    ) -> None:
        self._keep = keep
        self._datagram = b""
        self._link = link
        self._session = session
        self._stages = stages or StageClock()
        self._before: JointReport | None = None

    def read(self, now: float) -> ArmState | None:
        datagrams = self._stages.timed(RECEIVE, self._datagrams(now))
        if not datagrams:
            return None
        session = self._session
        message = accept_from(self._link, session, datagrams, now)
        if message is None:
            return None
        self._datagram = datagrams[-1]
        before = None if session.is_first or session.is_resumed else self._before
        self._before = message
        dt = period(before, message)
        return ArmState(
            now,
            dt,
            session.number,
            message.measured,
            ZERO if before is None or dt <= 0.0 else change_rate(message.measured, before.measured, dt),
            message.planned,
            is_running(message),
        )

    def _datagrams(self, now: float) -> Sequence[bytes]:
        """Everything that waits; of a robot that is on time only one can, and another look would cost time."""
        earliest, latest = PUNCTUAL
        if not earliest < self._session.silence(now) < latest or not self._link.is_pinned:
            return self._link.receive()
        datagram = self._link.receive_next()
        return () if datagram is None else (datagram,)

    def write(self, command: ArmCommand) -> None:
        velocity = None if command.velocity is ZERO else command.velocity
        self._link.send(self._stages.timed(ENCODE, self._session.reply(command.position, velocity)))
        self._stages.note(SEND)
        self._session.settle()
        self._keep(self._datagram)

    def silence(self, now: float) -> float:
        return self._session.silence(now)

    def lost_after(self, now: float) -> float | None:
        if not self._session.close_if_silent(now):
            return None
        self._link.release()
        return self._session.silence(now)

    def wire_counters(self) -> WireCounters:
        return wire_counters(self._session, self._link.foreign)


def is_running(message: JointReport | RobotMessage) -> bool:
    """Whether the robot follows; undefined counts: a restart of the controller leaves it so (reference/egm.md §3.3)."""
    return message.motors is _ON and message.mci is _RUNNING and message.rapid is not _STOPPED


def period(before: Counted | None, message: Counted) -> float:
    """Robot time from one message to the next [s], 0 where there is none before."""
    if before is None:
        return 0.0
    passed = message.measured_time - before.measured_time
    return passed if 0.0 < passed <= LONGEST_PERIOD else CYCLE


def wire_counters(session: SensorSession[Message], foreign: int) -> WireCounters:
    counters, arrivals = session.counters, session.arrivals
    return WireCounters(
        session.number,
        counters.missed,
        counters.lost,
        counters.late,
        counters.stale,
        counters.repeated,
        counters.malformed,
        foreign,
        arrivals.jitter,
        arrivals.worst_jitter,
        arrivals.drift_ppm,
        arrivals.cycle_time,
    )


class PerfectArm:
    """An arm without dynamics; every ``read`` is one cycle later.

    Attributes:
        is_running: whether it follows commands; set it to stop the robot.

    Args:
        position: where it begins, chain order [rad].
    """

    def __init__(self, position: Joints) -> None:
        self.is_running = True
        self._position = position
        self._velocity = ZERO
        self._dt = 0.0

    def read(self, now: float) -> ArmState | None:
        state = ArmState(now, self._dt, 1, self._position, self._velocity, self._position, self.is_running)
        self._dt = CYCLE
        return state

    def write(self, command: ArmCommand) -> None:
        if not self.is_running:
            return
        self._velocity = change_rate(command.position, self._position, CYCLE)
        self._position = command.position

    def silence(self, now: float) -> float:
        return 0.0

    def lost_after(self, now: float) -> float | None:
        return None

    def wire_counters(self) -> WireCounters:
        return WireCounters(session=1)


def start_controllers(
    manager: ControllerManager, controllers: Sequence[ControllerSettings]
) -> tuple[ControllerSettings, ...]:
    """Lead ``controllers`` to their initial states; their settings, each with its own parameters only.

    Raises:
        SettingsError: a type is unknown, a parameter not allowed or not known, or a state cannot be reached.
    """
    started = tuple(_start(manager, settings) for settings in controllers)
    # What stands under a wildcard must be for a controller: a mistyped word would pass unseen.
    taken = {entry.place for settings in started for entry in settings.entries.values()}
    for settings in controllers:
        for key, entry in settings.entries.items():
            if entry.place not in taken and not key.endswith(MANAGER_SETTINGS):
                raise SettingsError(f"{entry.place}: no controller has a parameter {key!r}.")
    return started


def _start(manager: ControllerManager, settings: ControllerSettings) -> ControllerSettings:
    name, state = settings.name, settings.state
    if settings.kind not in manager.kinds:
        known = ", ".join(manager.kinds)
        raise SettingsError(f"{settings.place}: controller {name!r} has type {settings.kind!r}; known are: {known}.")
    if state is InitialState.UNLOADED:
        return settings
    place = settings.place  # of what may be refused
    try:
        manager.load_kind(name, settings.kind)
        has = [info.parameter for info in manager.parameters(name)]
        own = {
            key: entry for key, entry in settings.entries.items() if find_parameter(has, key) or not entry.is_general
        }
        for key, entry in own.items():
            place = entry.place
            manager.set_parameters(name, {key: entry.value})
        place = settings.place
        if state is not InitialState.UNCONFIGURED:
            manager.configure(name)
            commands = any(info.required for info in manager.controllers() if info.name == name)
            if state is InitialState.ACTIVE or (state is None and not commands):
                manager.switch((name,), (), None)
    except (CommandRefused, SwitchFailed) as refusal:
        raise SettingsError(f"{place}: {refusal}") from refusal
    return replace(settings, entries=own)


Controllers = Mapping[Side, tuple[ControllerSettings, ...]]


@dataclass(frozen=True, slots=True)
class Place:
    """What a controller is given when it is made in the control process.

    Attributes:
        name: the controller's name.
        side: its arm.
        buffers: what its arm shares with the driver process.
        halves: controllers of this name that are active, by arm, for one that moves both arms.
        limits: what the joints may do in the robot's EGM motion.
        period: time between two datagrams of the arm [s].
        speed: the factor on its speeds.
        tool_limits: what its tool keeps.
    """

    name: str
    side: Side
    buffers: ArmBuffers
    halves: dict[Side, DualArmTrajectoryController]
    limits: JointLimits
    period: float
    speed: SpeedScale
    tool_limits: ToolLimits = ToolLimits()  # noqa: RUF009 - it is frozen


def _forwarding(kind: type[ForwardCommandController], place: Place) -> Controller:
    return kind(place.buffers.forward_positions, place.buffers.forward_speeds, place.limits, place.speed)


CONTROLLER_KINDS: Mapping[str, Callable[[Place], Controller]] = {
    JointStateBroadcaster.kind: lambda place: JointStateBroadcaster(place.buffers.states),
    JointPositionController.kind: lambda place: JointPositionController(place.buffers.goals, place.limits, place.speed),
    JointVelocityController.kind: lambda place: JointVelocityController(
        place.buffers.speeds, place.limits, place.speed
    ),
    **{kind.kind: partial(_forwarding, kind) for kind in FORWARDERS},
    JointTrajectoryController.kind: lambda place: JointTrajectoryController(
        place.side, place.buffers.trajectory, place.limits, speed=place.speed
    ),
    DualArmTrajectoryController.kind: lambda place: DualArmTrajectoryController(
        place.side,
        place.buffers.dual_trajectory,
        place.halves,
        place.limits,
        place.speed,
    ),
    CartesianController.kind: lambda place: CartesianController(
        place.side,
        place.buffers.tool_goals,
        place.buffers.tool_path,
        place.limits,
        place.speed,
        place.tool_limits,
    ),
    JointGoalController.kind: lambda place: JointGoalController(
        place.buffers.point_goals, place.limits, place.period, place.speed
    ),
}
"""How a controller of each type is made."""


@dataclass(frozen=True, slots=True)
class EgmPlan:
    """Where the control process listens; plain values, since it is sent there.

    Attributes:
        listen: local address.
        remote: the robot's address; datagrams from elsewhere are left aside.
        ports: UDP port per arm.
        silence: the robot is lost after this time [s].
        period: time between two datagrams of an arm [s].
        controllers: what runs on each arm.
        position_gain: of the robot's own position loop [1/s].
        limits: what the joints may do in the robot's EGM motion.
        prefix: before the names of joints.
        collision: what keeps the arms apart.
        grippers: the modules of each gripper.
        tool_limits: what the tools keep.
    """

    listen: str
    remote: str
    ports: Mapping[Side, int]
    silence: float
    period: float
    controllers: Controllers
    position_gain: float = EGM_GAIN
    limits: JointLimits = YUMI_LIMITS
    prefix: str = ""
    collision: CollisionSettings = field(default_factory=lambda: CollisionSettings(enabled=False))
    grippers: Mapping[Side, GripperModules] = field(default_factory=lambda: SERVO_GRIPPERS)
    tool_limits: ToolLimits = ToolLimits()  # noqa: RUF009 - it is frozen

    @property
    def addresses(self) -> Mapping[Side, EgmAddress]:
        """Where each arm's datagrams are awaited."""
        return {side: EgmAddress(self.listen, port) for side, port in self.ports.items()}


def plan_egm(settings: Settings, controllers: Controllers) -> EgmPlan:
    """Where to listen for the robot of ``settings``.

    Raises:
        NoConnection: there is no way to the robot's address.
        SettingsError: a controller has an unknown type, or parameters it cannot have.
    """
    remote = resolve(settings.robot.address)
    listen = address_towards(remote) if settings.egm.listen == "auto" else settings.egm.listen
    ports = {side: settings.egm.port(side) for side in Side}
    motion = settings.egm_motion
    return EgmPlan(
        listen,
        remote,
        ports,
        settings.egm.silence,
        motion.sample_rate * 1e-3,
        check_controllers(controllers),
        position_gain=EGM_GAIN * motion.pos_corr_gain,
        limits=YUMI_LIMITS.slowed_to(radians(motion.max_speed_deviation)),
        prefix=settings.ros.prefix,
        collision=settings.collision,
        grippers={side: settings.gripper.modules(side) for side in Side},
        tool_limits=settings.tool_limits.limits,
    )


def check_controllers(controllers: Controllers) -> Controllers:
    """``controllers`` as the control process can start them: tried, and without what a wildcard says for others.

    Raises:
        SettingsError: a controller has an unknown type, a parameter it cannot have, or a state it cannot start in.
    """
    halves: Halves = {}
    return {
        side: start_controllers(_manager_of(side, ArmBuffers(), halves), entries)
        for side, entries in controllers.items()
    }


Halves = dict[str, dict[Side, DualArmTrajectoryController]]
"""The active halves of controllers that move both arms, by the controllers' name and arm."""


def _manager_of(
    side: Side,
    buffers: ArmBuffers,
    halves: Halves,
    limits: JointLimits = YUMI_LIMITS,
    period: float = CYCLE,
    speed: SpeedScale | None = None,
    tool_limits: ToolLimits = ToolLimits(),  # noqa: B008 - it is frozen
) -> ControllerManager:
    speed = speed or SpeedScale()

    def factory(make: Callable[[Place], Controller]) -> Callable[[str], Controller]:
        return lambda name: make(
            Place(name, side, buffers, halves.setdefault(name, {}), limits, period, speed, tool_limits)
        )

    kinds = {kind: factory(make) for kind, make in CONTROLLER_KINDS.items()}
    counted = read_snapshot(buffers.snapshots).activity
    return ControllerManager(joint_names(side), kinds, side.unit, time.monotonic, counted)


def build_arms(plan: EgmPlan, buffers: Mapping[Side, ArmBuffers]) -> Mapping[Side, ConnectedArm]:
    """Both arms of the control process, with the controllers that only watch already active."""
    set_prefix(plan.prefix)
    halves: Halves = {}
    arms: dict[Side, ConnectedArm] = {}
    collisions = None
    if plan.collision.enabled:
        collisions = CollisionLimiter(
            plan.collision.model(plan.grippers), plan.limits, plan.position_gain, plan.collision.margin
        )

    def position(side: Side) -> Joints | None:
        return arms[side].loop.position if side in arms else None

    for side, own in buffers.items():
        socket = UdpServer(plan.listen, plan.ports[side], remote=plan.remote)
        stages, speed = StageClock(time.monotonic), SpeedScale(own.speed_scale)
        manager = _manager_of(side, own, halves, plan.limits, plan.period, speed, plan.tool_limits)
        start_controllers(manager, plan.controllers[side])
        arm = EgmArm(socket, SensorSession(JointCodec(), silence=plan.silence), stages, own.datagram.write)
        apart = collisions.arm(side) if collisions else None
        limiter = Limiter(plan.limits, plan.period, plan.position_gain, partial(position, side.other), apart)
        recorder = FlightRecorder(own.flight)
        loop = ArmLoop(
            side,
            arm,
            manager,
            limiter,
            own.snapshots,
            recorder,
            stages,
            plan.period,
            speed,
            collisions,
            own.read_joints,
        )
        arms[side] = ConnectedArm(loop, socket)
    return arms


def first_speed_scale(settings: Settings) -> float:
    """What speeds begin with: slow at a robot that is not on this machine, unless the settings say otherwise."""
    if settings.robot.speed_scale is not None:
        return settings.robot.speed_scale
    return FULL if ip_address(resolve(settings.robot.address)).is_loopback else FIRST_CONTACT


class DriverParts(NamedTuple):
    """What drives one robot, made and not started.

    Attributes:
        client: the way to the controller; closed by who made it.
        bringup: what is done over RWS.
        plan: where the control process listens.
        control: the control process.
        manager: the robot's state.
        signals: the grippers' signals, by subscription.
        grippers: both.
    """

    client: RwsClient
    bringup: Bringup
    plan: EgmPlan
    control: ControlProcess
    manager: RobotManager
    signals: GripperSignals
    grippers: Mapping[Side, Gripper]


def make_parts(
    settings: Settings,
    controllers: Controllers,
    on_event: Callable[[Event], None],
    report: Callable[[str], None],
    leading: str | None = None,
    arms: tuple[Side, ...] = tuple(Side),
    warn: Callable[[str], None] | None = None,
    stops: StopLog | None = None,
) -> DriverParts:
    """The parts for the robot of ``settings``.

    Args:
        settings: where it is, and how it moves.
        controllers: what runs on each arm.
        on_event: called with what happens in the control process.
        report: called with each step of what is done to the robot.
        leading: the controller that commands an arm after EGM has started; None: as the settings say.
        arms: those that EGM moves; the others stand still.
        warn: called with what is not as it should be; None: ``report`` is.
        stops: what stopped the robot, where an earlier connection knows it already.

    Raises:
        NoConnection: there is no way to the robot's address.
        SettingsError: a controller has an unknown type, or parameters it cannot have.
    """
    set_prefix(settings.ros.prefix)
    clock, robot, plan = SystemClock(), settings.robot, plan_egm(settings, controllers)
    first = leading or settings.ros.initial_joint_controller
    for side, entries in plan.controllers.items():
        ready = {each.name: each for each in entries if each.state in {None, InitialState.INACTIVE}}
        if side in arms and (first not in ready or ready[first].kind == JointStateBroadcaster.kind):
            choices = ", ".join(name for name, each in ready.items() if each.kind != JointStateBroadcaster.kind)
            raise SettingsError(
                f"ros.initial_joint_controller is {first!r}, which does not command the {side.word} arm; choose from: "
                f"{choices}."
            )
    client = RwsClient(
        f"{robot.address}:{robot.rws_port}", user=robot.user, password=robot.password, timeout=robot.timeout
    )
    control = ControlProcess(partial(build_arms, plan), on_event, settings.egm.wake)
    scales = {side: each.speed_scale for side, each in control.buffers.items()}
    speed = SpeedSetting(first_speed_scale(settings), scales, lambda side: control.snapshot(side).is_running)
    bringup = Bringup(client, settings.egm_motion, clock, report, arms, warn, speed)
    manager = RobotManager(bringup, control, clock, first, arms, settings.watchdog, stops, settings.recovery)
    if settings.collision.enabled:  # an arm without EGM is kept clear of, too
        manager.monitor.keeps_apart = True
        manager.monitor.on_joints = lambda side, states: control.buffers[side].read_joints.write(states)
    signals = GripperSignals(client, {side: settings.gripper.modules(side) for side in Side})
    grippers = build_grippers(client, clock, settings, signals)
    manager.grippers = tuple(grippers.values())
    return DriverParts(client, bringup, plan, control, manager, signals, grippers)


def only_at_robot(settings: Settings) -> SingleInstance:
    """What makes sure that one program of this machine drives the robot of ``settings``."""
    address = f"{resolve(settings.robot.address)}:{settings.robot.rws_port}"
    refusal = (
        f"The robot at {address} is driven by another program ({{owner}}); end it first, or have that one move the "
        "robot: `yumi state` and the other commands, yumi.attach() in a script."
    )
    return SingleInstance(f"yumi-drives-{address}", refusal)


def build_grippers(
    client: RwsClient, clock: Clock, settings: Settings, signals: GripperSignals | None = None
) -> dict[Side, Gripper]:
    """Both grippers of a connected robot; without ``signals`` they read everything by request."""
    routines, own = GripperRoutines(client, clock), settings.gripper
    return {
        side: Gripper(side, client, routines, clock, own.timeout, own.speed, own.modules(side), signals)
        for side in Side
    }
