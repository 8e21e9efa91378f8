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
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from math import radians
from typing import NamedTuple

from abb_protocols.catalogue import message
from abb_protocols.errors import SettingsError, YumiError
from abb_protocols.robot.description import SERVO_GRIPPERS
from abb_protocols.robot.gripper_values import GripperModules
from abb_protocols.robot.joints import YUMI_LIMITS, JointLimits, Side, set_prefix
from abb_runtime.clock import Clock, SystemClock
from abb_runtime.faults import takes_faults
from abb_runtime.process.single_instance import SingleInstance
from abb_runtime.rws.client import RwsClient
from abb_runtime.udp import UdpServer, address_of_host
from yumi.control.collisions import CollisionLimiter
from yumi.control.controllers.joint_state_broadcaster import JointStateBroadcaster
from yumi.control.flight_recorder import FlightRecorder
from yumi.control.limiter import Limiter
from yumi.control.loop import ArmLoop
from yumi.control.loop_events import Event
from yumi.control.motion.robot_response import EGM_GAIN
from yumi.control.speed_scale import SpeedScale
from yumi.control.stage_times import StageClock
from yumi.control.tool_limits import ToolLimits
from yumi.driver.bringup import Bringup
from yumi.driver.control_process import ArmBuffers, ControlProcess, ControlProcessArm
from yumi.driver.egm_arm import EgmArm, FallbackThread
from yumi.driver.gripper import GripperRoutines, RwsGripper
from yumi.driver.gripper_signals import GripperSignals
from yumi.driver.initial_controllers import (
    Controllers,
    Halves,
    check_controllers,
    controller_manager_of,
    start_controllers,
)
from yumi.driver.launch_checks import EgmAddress
from yumi.driver.rapid_motion_check import RapidMotionCheck
from yumi.driver.robot_manager import RobotManager
from yumi.driver.settings import CollisionSettings, InitialState, Settings
from yumi.driver.speed_setting import SpeedSetting
from yumi.driver.stops import StopLog
from yumi.egm.egm_session import Session


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
    client = robot.client()
    asks_whether_real = partial(is_real, client, is_here=robot.is_on_this_machine)
    control = ControlProcess(partial(build_arms, plan), on_event, settings.egm.wake)
    scales = {side: each.speed_scale for side, each in control.buffers.items()}
    speed = SpeedSetting(robot.first_speed_scale, scales, lambda side: control.snapshot(side).is_running)
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
        is_real=asks_whether_real,
        begins_as_real=robot.speed_scale is not None or not robot.is_on_this_machine,
        rapid_check=RapidMotionCheck(
            client,
            bringup.panel,
            bringup.machines,
            settings.collision.model(plan.grippers) if settings.collision.enabled else None,
            settings.collision.margin,
            is_real=asks_whether_real,
        ),
    )
    if settings.collision.enabled:  # an arm without EGM is kept clear of, too
        manager.monitor.keeps_apart = True
        manager.monitor.on_joints = lambda side, states: control.buffers[side].read_joints.write(states)
    signals = GripperSignals(client, {side: settings.gripper.modules(side) for side in Side})
    grippers = _build_grippers(client, clock, settings, signals)
    manager.grippers = tuple(grippers.values())
    return DriverParts(client, bringup, plan, control, manager, signals, grippers)


def is_real(client: RwsClient, *, is_here: bool) -> bool:
    """Whether a robot is real, and moves nothing that no call names; asked anew each time: another one may answer.

    One whose address is of this machine is real, too, unless what answers there says that it is virtual: a tunnel may
    begin there. The virtual controller of this project takes any number of requests a second; all others are spared.
    """
    if not is_here:
        return True
    if takes_faults(client.address):
        client.lift_rate_limit()
        return False
    try:
        return not client.identity().is_virtual
    except YumiError:  # nothing says that it is
        return True


def _build_grippers(
    client: RwsClient, clock: Clock, settings: Settings, signals: GripperSignals
) -> dict[Side, RwsGripper]:
    """Both grippers of a connected robot."""
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
    ports = {side: settings.egm.port(side) for side in Side}
    motion = settings.egm_motion
    return EgmPlan(
        settings.egm.listen_for(remote),
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


def build_arms(plan: EgmPlan, buffers: Mapping[Side, ArmBuffers]) -> Mapping[Side, ControlProcessArm]:
    """Both arms of the control process, with the controllers that only watch already active."""
    set_prefix(plan.prefix)
    halves: Halves = {}
    arms: dict[Side, ControlProcessArm] = {}
    answered: list[tuple[Limiter, EgmArm]] = []
    collisions = None
    if plan.collision.enabled:
        collisions = CollisionLimiter(
            plan.collision.model(plan.grippers), plan.limits, plan.position_gain, plan.collision.margin
        )

    for side, own in buffers.items():
        socket = UdpServer(plan.listen, plan.ports[side], remote=plan.remote)
        stages, speed = StageClock(time.monotonic), SpeedScale(own.speed_scale)
        manager = controller_manager_of(side, own, halves, plan.limits, plan.period, speed, plan.tool_limits)
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
        arms[side] = ControlProcessArm(loop, socket)
        answered.append((limiter, arm))
    for (limiter, _), (other, _) in pairwise(answered):
        limiter.pair(other)
    fallback = FallbackThread(arm for _, arm in answered)
    return {side: arm._replace(fallback=fallback) for side, arm in arms.items()}
