"""The wiring plan: which objects, threads and processes make up the driver.

::

    yumi up          process 1     RWS client, robot manager, grippers, ROS nodes
                                   threads: answers (five), streams, timers, slow-timers-r and -l, signal-timers,
                                            joint-states-r, joint-states-l, grippers, gripper-streams (two at most),
                                            robot-monitor, watchdog, control-events,
                                            automatic-recovery (recovery.automatic), all of
                                            them supervised (process/supervision.py); endpoint, endpoint-work (16 at
                                            most);
                                            web-socket (opened again by who listens), flight-records and
                                            flight-records-after (when something stops),
                                            full-recorder (--record; a broken file is not begun again),
                                            end-in-time, forced-end
                     process 2     the control process: the cycles of both arms, one thread

Also the controllers that an arm starts with, and how each is led to its initial state.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from ipaddress import ip_address
from itertools import pairwise
from math import radians
from typing import Any, NamedTuple

from abb_protocols.catalogue import message, said_by
from abb_protocols.errors import CommandRefused, ControllerRefused, SettingsError, SwitchFailed
from abb_protocols.robot.description import SERVO_GRIPPERS
from abb_protocols.robot.gripper_values import GripperModules
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, JointLimits, Side, joint_names, set_prefix
from abb_runtime.clock import Clock, SystemClock
from abb_runtime.faults import takes_faults
from abb_runtime.process.single_instance import SingleInstance
from abb_runtime.rws.client import RwsClient
from abb_runtime.udp import UdpServer, address_of_host, address_towards
from yumi.control.collisions import CollisionLimiter
from yumi.control.controller import Controller, find_controller_parameter
from yumi.control.controllers import find_controllers
from yumi.control.controllers.joint_state_broadcaster import JointStateBroadcaster
from yumi.control.flight_recorder import FlightRecorder
from yumi.control.limiter import Limiter
from yumi.control.loop import ArmLoop
from yumi.control.loop_events import Event
from yumi.control.manager.controller_manager import ControllerManager
from yumi.control.motion.robot_response import EGM_GAIN
from yumi.control.place import Place
from yumi.control.shared_state import read_snapshot
from yumi.control.speed_scale import FULL, SpeedScale
from yumi.control.stage_times import StageClock
from yumi.control.tool_limits import ToolLimits
from yumi.driver.bringup import Bringup
from yumi.driver.control_process import ArmBuffers, ConnectedArm, ControlProcess
from yumi.driver.egm_arm import EgmArm, FallbackThread
from yumi.driver.gripper import GripperRoutines, GripperSignals, RwsGripper
from yumi.driver.launch_checks import EgmAddress
from yumi.driver.rapid_motion_check import RapidMotionCheck
from yumi.driver.robot_manager import RobotManager
from yumi.driver.settings import MANAGER_SETTINGS, CollisionSettings, ControllerSettings, InitialState, Settings
from yumi.driver.state_machine import FIRST_SPEED_SCALE, SpeedSetting
from yumi.driver.stops import StopLog
from yumi.egm.egm_session import Session

Controllers = Mapping[Side, tuple[ControllerSettings, ...]]
"""What runs on each arm."""


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
    grippers: Mapping[Side, RwsGripper]


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
            choices = tuple(name for name, each in ready.items() if each.kind != JointStateBroadcaster.kind)
            raise SettingsError(
                message(
                    "initial_controller_commands_nothing",
                    setting="ros.initial_joint_controller",
                    controller=first,
                    arm=side.word,
                    choices=choices,
                )
            )
    client = RwsClient(
        f"{robot.address}:{robot.rws_port}", user=robot.user, password=robot.password, timeout=robot.timeout
    )
    control = ControlProcess(partial(build_arms, plan), on_event, settings.egm.wake)
    scales = {side: each.speed_scale for side, each in control.buffers.items()}
    speed = SpeedSetting(first_speed_scale(settings), scales, lambda side: control.snapshot(side).is_running)
    bringup = Bringup(client, settings.egm_motion, clock, report, arms, warn, speed)
    manager = RobotManager(
        bringup,
        control,
        clock,
        first,
        arms,
        settings.watchdog,
        stops,
        settings.recovery,
        is_real=not is_on_this_machine(settings),
        rapid_check=RapidMotionCheck(
            client,
            bringup.panel,
            bringup.machines,
            settings.collision.model(plan.grippers) if settings.collision.enabled else None,
            settings.collision.margin,
            is_real=lambda: manager.is_real,  # the connection may find out that the robot is real
        ),
    )
    if settings.collision.enabled:  # an arm without EGM is kept clear of, too
        manager.monitor.keeps_apart = True
        manager.monitor.on_joints = lambda side, states: control.buffers[side].read_joints.write(states)
    signals = GripperSignals(client, {side: settings.gripper.modules(side) for side in Side})
    grippers = build_grippers(client, clock, settings, signals)
    manager.grippers = tuple(grippers.values())
    return DriverParts(client, bringup, plan, control, manager, signals, grippers)


def first_speed_scale(settings: Settings) -> float:
    """What speeds begin with: slow at a robot that is not on this machine, unless the settings say otherwise."""
    if settings.robot.speed_scale is not None:
        return settings.robot.speed_scale
    return FULL if is_on_this_machine(settings) else FIRST_SPEED_SCALE


def is_on_this_machine(settings: Settings) -> bool:
    """Whether the robot is on this machine, and so no real one."""
    return ip_address(address_of_host(settings.robot.address)).is_loopback


def check_kind(manager: RobotManager, client: RwsClient, settings: Settings) -> None:
    """Take a robot on this machine for a real one, too, unless its controller is known to be virtual: see tunnels.

    The virtual controller of this project takes any number of requests a second; all others are spared.

    Raises:
        YumiError: the controller does not answer.
    """
    robot = settings.robot
    if manager.is_real:
        return
    if takes_faults(f"{robot.address}:{robot.rws_port}"):
        client.lift_pace()
        return
    try:
        is_virtual = client.identity().is_virtual
    except ControllerRefused:
        is_virtual = False
    if not is_virtual:
        manager.take_for_real()


def brings_up(settings: Settings, *, is_real: bool) -> bool:
    """Whether a driver brings the robot to ready when it starts: a real one only where that is named."""
    return not is_real if settings.ros.bringup is None else settings.ros.bringup


def build_grippers(
    client: RwsClient, clock: Clock, settings: Settings, signals: GripperSignals | None = None
) -> dict[Side, RwsGripper]:
    """Both grippers of a connected robot; without ``signals`` they read everything by request."""
    routines, own = GripperRoutines(client, clock), settings.gripper
    return {
        side: RwsGripper(side, client, routines, clock, own.timeout, own.speed, own.modules(side), signals)
        for side in Side
    }


def only_at_robot(settings: Settings) -> SingleInstance:
    """What makes sure that one program of this machine drives the robot of ``settings``."""
    address = f"{address_of_host(settings.robot.address)}:{settings.robot.rws_port}"
    return SingleInstance(
        f"yumi-drives-{address}", lambda owner: message("robot_driven_by_another", address=address, owner=owner)
    )


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
        bandwidth: of the robot's low-pass filter on the speed [Hz]; 0 is none.
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
    bandwidth: float = 0.0
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
    remote = address_of_host(settings.robot.address)
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
        bandwidth=motion.lp_filter,
        limits=YUMI_LIMITS.slowed_to(radians(motion.max_speed_deviation)),
        prefix=settings.ros.prefix,
        collision=settings.collision,
        grippers={side: settings.gripper.modules(side) for side in Side},
        tool_limits=settings.tool_limits.limits,
    )


def build_arms(plan: EgmPlan, buffers: Mapping[Side, ArmBuffers]) -> Mapping[Side, ConnectedArm]:
    """Both arms of the control process, with the controllers that only watch already active."""
    set_prefix(plan.prefix)
    halves: Halves = {}
    arms: dict[Side, ConnectedArm] = {}
    answered: list[tuple[Limiter, EgmArm]] = []
    collisions = None
    if plan.collision.enabled:
        collisions = CollisionLimiter(
            plan.collision.model(plan.grippers), plan.limits, plan.position_gain, plan.collision.margin
        )

    for side, own in buffers.items():
        socket = UdpServer(plan.listen, plan.ports[side], remote=plan.remote)
        stages, speed = StageClock(time.monotonic), SpeedScale(own.speed_scale)
        manager = _manager_of(side, own, halves, plan.limits, plan.period, speed, plan.tool_limits)
        start_controllers(manager, plan.controllers[side])
        apart = collisions.arm(side) if collisions else None
        limiter = Limiter(plan.limits, plan.period, plan.position_gain, apart, plan.bandwidth)
        arm = EgmArm(socket, Session(plan.silence), limiter, stages, own.datagram.write)
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
            own.deadline,
        )
        arms[side] = ConnectedArm(loop, socket)
        answered.append((limiter, arm))
    for (limiter, _), (other, _) in pairwise(answered):
        limiter.pair(other)
    fallback = FallbackThread(arm for _, arm in answered)
    return {side: arm._replace(fallback=fallback) for side, arm in arms.items()}


Halves = dict[str, dict[Side, Any]]
"""The active halves of controllers that move both arms, by the controllers' name and arm."""


CONTROLLER_KINDS: Mapping[str, Callable[[Place], Controller]] = {each.kind: each.make for each in find_controllers()}
"""How a controller of each type is made."""


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


def start_controllers(
    manager: ControllerManager, controllers: Sequence[ControllerSettings]
) -> tuple[ControllerSettings, ...]:
    """Lead ``controllers`` to their initial states; their settings, each with its own parameters only.

    Raises:
        SettingsError: a type is unknown, a parameter not allowed or not known, or a state cannot be reached.
    """
    started = tuple(_start_controller(manager, settings) for settings in controllers)
    # What stands under a wildcard must be for a controller: a mistyped word would pass unseen.
    taken = {entry.place for settings in started for entry in settings.entries.values()}
    for settings in controllers:
        for key, entry in settings.entries.items():
            if entry.place not in taken and not key.endswith(MANAGER_SETTINGS):
                raise SettingsError(message("parameter_of_no_controller", place=entry.place, parameter=key))
    return started


def _start_controller(manager: ControllerManager, settings: ControllerSettings) -> ControllerSettings:
    name, state = settings.name, settings.state
    if settings.kind not in manager.kinds:
        raise SettingsError(
            message(
                "controller_of_unknown_type",
                place=settings.place,
                controller=name,
                type=settings.kind,
                known=tuple(manager.kinds),
            )
        )
    if state is InitialState.UNLOADED:
        return settings
    place = settings.place  # of what may be refused
    try:
        manager.load_kind(name, settings.kind)
        has = [info.parameter for info in manager.parameters(name)]
        own = {
            key: entry
            for key, entry in settings.entries.items()
            if find_controller_parameter(has, key) or not entry.is_general
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
        raise SettingsError(message("setting_refused", place=place, reason=said_by(refusal))) from refusal
    return replace(settings, entries=own)
