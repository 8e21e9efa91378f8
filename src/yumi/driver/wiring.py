"""The wiring plan: which objects, threads and processes make up the driver.

::

    yumi up          process 1     RWS client, robot manager, grippers, ROS nodes
                                   threads: answers (five), streams, ticker, slow-ticker-r and -l, joint-states-r,
                                            joint-states-l, hands, robot-watch, watchdog, fast-line-events (two),
                                            automatic-recovery (recovery.automatic), all of them supervised
                                            (links/supervision.py);
                                            web-socket (opened again by who listens), flight-records (when something
                                            stops), full-recorder (--record; a broken file is not begun again),
                                            end-in-time, forced-end
                     process 2, 3  the fast lines: one arm's cycles each, one thread

The controllers an arm starts with: loaded, given their parameters and led to their initial states.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from ipaddress import ip_address
from math import radians
from typing import NamedTuple

from yumi.clock import Clock, SystemClock
from yumi.control.controller import Controller
from yumi.control.controller_manager import ControllerManager
from yumi.control.controllers.forward_command import FORWARDERS, ForwardCommandController
from yumi.control.controllers.joint_goal import JointGoalController
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.controllers.joint_state_broadcaster import JointStateBroadcaster
from yumi.control.controllers.joint_trajectory import DualArmTrajectoryController, JointTrajectoryController
from yumi.control.controllers.joint_velocity import JointVelocityController
from yumi.control.flight_recorder import FlightRecorder
from yumi.control.limiter import FULL, Guard, SpeedScale
from yumi.control.loop import ArmLine
from yumi.control.motion import EGM_GAIN
from yumi.control.requests import Event
from yumi.control.statistics import StationClock
from yumi.driver.arm import EgmArm
from yumi.driver.bringup import Bringup, EgmAddress
from yumi.driver.control_process import ArmBoxes, FastLines, Rehearsal, WiredArm
from yumi.driver.gripper import Gripper
from yumi.driver.gripper_io import GripperRoutines, GripperSignals
from yumi.driver.robot_manager import POSITION_CONTROLLER, RobotManager
from yumi.driver.settings import MANAGER_SETTINGS, ControllerSettings, InitialState, Settings
from yumi.driver.speed import FIRST_CONTACT, SpeedSetting
from yumi.driver.stops import StopLog
from yumi.egm.codec import JointCodec
from yumi.egm.session import SensorSession
from yumi.egm.udp import UdpServer, address_towards, resolve
from yumi.errors import CommandRefused, SettingsError, SwitchFailed
from yumi.process.single_instance import Only
from yumi.robot.joints import CYCLE, YUMI_LIMITS, JointLimits, Side, joint_names
from yumi.rws.client import RwsClient


def start_controllers(
    manager: ControllerManager, controllers: Sequence[ControllerSettings]
) -> tuple[ControllerSettings, ...]:
    """Lead ``controllers`` to their initial states; their settings, each with its own parameters only.

    Raises:
        SettingsError: a type is unknown, a parameter not allowed or known to nobody, or a state cannot be reached.
    """
    started = tuple(_start(manager, settings) for settings in controllers)
    _check_general(controllers, started)
    return started


def _start(manager: ControllerManager, settings: ControllerSettings) -> ControllerSettings:
    if settings.kind not in manager.kinds:
        known = ", ".join(manager.kinds)
        raise SettingsError(
            f"{settings.place}: controller {settings.name!r} has type {settings.kind!r}; known are: {known}."
        )
    if settings.state is InitialState.UNLOADED:
        return settings
    try:
        manager.load_kind(settings.name, settings.kind)
    except CommandRefused as refusal:
        raise SettingsError(f"{settings.place}: {refusal}") from refusal
    own = _set_parameters(manager, settings)
    _lead_to_state(manager, settings)
    return own


def _set_parameters(manager: ControllerManager, settings: ControllerSettings) -> ControllerSettings:
    """One by one, so that a refusal names its line."""
    known = {info.parameter.name for info in manager.parameters(settings.name)}
    own = {key: entry for key, entry in settings.entries.items() if key in known or not entry.is_general}
    for key, entry in own.items():
        try:
            manager.set_parameters(settings.name, {key: entry.value})
        except CommandRefused as refusal:
            raise SettingsError(f"{entry.place}: {refusal}") from refusal
    return replace(settings, entries=own)


def _lead_to_state(manager: ControllerManager, settings: ControllerSettings) -> None:
    if settings.state is InitialState.UNCONFIGURED:
        return
    try:
        manager.configure(settings.name)
        if settings.state is InitialState.ACTIVE or (settings.state is None and not _commands(manager, settings.name)):
            manager.switch((settings.name,), (), None)
    except (CommandRefused, SwitchFailed) as refusal:
        raise SettingsError(f"{settings.place}: {refusal}") from refusal


def _commands(manager: ControllerManager, name: str) -> bool:
    return any(info.required for info in manager.controllers() if info.name == name)


def _check_general(controllers: Sequence[ControllerSettings], started: Sequence[ControllerSettings]) -> None:
    """What stands under a wildcard must be for somebody: another mistyped word would pass in silence."""
    taken = {entry.place for settings in started for entry in settings.entries.values()}
    for settings in controllers:
        for key, entry in settings.entries.items():
            if entry.place not in taken and not key.endswith(MANAGER_SETTINGS):
                raise SettingsError(f"{entry.place}: no controller has a parameter {key!r}.")


Controllers = Mapping[Side, tuple[ControllerSettings, ...]]


@dataclass(frozen=True, slots=True)
class Place:
    """Where a controller is made, in the fast line: what it may be given.

    Attributes:
        name: the controller's name.
        side: its arm.
        boxes: what its arm shares with the other processes.
        partner: what the other arm shares with them.
        limits: what the joints may do in the robot's EGM motion.
        period: time between two datagrams of the arm [s].
        speed: the factor on its speeds.
    """

    name: str
    side: Side
    boxes: ArmBoxes
    partner: ArmBoxes
    limits: JointLimits
    period: float
    speed: SpeedScale


def _forwarding(kind: type[ForwardCommandController], place: Place) -> Controller:
    return kind(place.boxes.forward_positions, place.boxes.forward_speeds, place.limits, place.speed)


CONTROLLER_KINDS: Mapping[str, Callable[[Place], Controller]] = {
    JointStateBroadcaster.kind: lambda place: JointStateBroadcaster(place.boxes.states),
    JointPositionController.kind: lambda place: JointPositionController(place.boxes.goals, place.limits, place.speed),
    JointVelocityController.kind: lambda place: JointVelocityController(place.boxes.speeds, place.limits, place.speed),
    **{kind.kind: partial(_forwarding, kind) for kind in FORWARDERS},
    JointTrajectoryController.kind: lambda place: JointTrajectoryController(
        place.side, place.boxes.trajectory, place.limits, speed=place.speed
    ),
    DualArmTrajectoryController.kind: lambda place: DualArmTrajectoryController(
        place.side,
        place.boxes.dual_trajectory,
        place.boxes.dual_status,
        place.partner.dual_status,
        place.limits,
        place.speed,
    ),
    JointGoalController.kind: lambda place: JointGoalController(
        place.boxes.point_goals, place.limits, place.period, place.speed
    ),
}
"""How a controller of each type is made."""


@dataclass(frozen=True, slots=True)
class EgmPlan:
    """Where the fast line listens; plain values, since it is sent to another process.

    Attributes:
        listen: local address.
        remote: the robot's address; datagrams from elsewhere are left aside.
        ports: UDP port per arm.
        silence: the robot is lost after this time [s].
        period: time between two datagrams of an arm [s].
        controllers: what runs on each arm.
        position_gain: of the robot's own position loop [1/s].
        limits: what the joints may do in the robot's EGM motion.
    """

    listen: str
    remote: str
    ports: Mapping[Side, int]
    silence: float
    period: float
    controllers: Controllers
    position_gain: float = EGM_GAIN
    limits: JointLimits = YUMI_LIMITS

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
    )


def check_controllers(controllers: Controllers) -> Controllers:
    """``controllers`` as the fast line can start them: tried out, and without what stands under a wildcard for others.

    Raises:
        SettingsError: a controller has an unknown type, a parameter it cannot have, or a state it cannot start in.
    """
    boxes = {side: ArmBoxes() for side in Side}
    return {side: start_controllers(_manager_of(side, boxes), entries) for side, entries in controllers.items()}


def _manager_of(
    side: Side,
    boxes: Mapping[Side, ArmBoxes],
    limits: JointLimits = YUMI_LIMITS,
    period: float = CYCLE,
    speed: SpeedScale | None = None,
) -> ControllerManager:
    speed = speed or SpeedScale()

    def factory(make: Callable[[Place], Controller]) -> Callable[[str], Controller]:
        return lambda name: make(Place(name, side, boxes[side], boxes[side.other], limits, period, speed))

    kinds = {kind: factory(make) for kind, make in CONTROLLER_KINDS.items()}
    return ControllerManager(joint_names(side), kinds, side.unit, time.monotonic)


def build_arm(plan: EgmPlan, side: Side, boxes: Mapping[Side, ArmBoxes]) -> WiredArm:
    """An arm of the fast line, with the controllers that only watch already active."""
    socket = UdpServer(plan.listen, plan.ports[side], remote=plan.remote)
    stations = StationClock(time.monotonic)
    own = boxes[side]
    speed = SpeedScale(own.speed_scale)
    arm, manager, guard = _parts_of_arm(side, plan, boxes, socket, stations, speed)
    line = ArmLine(side, arm, manager, guard, own.snapshots, FlightRecorder(own.flight), stations, plan.period, speed)
    return WiredArm(line, socket, _rehearsal_of(side, plan, socket).run)


def _rehearsal_of(side: Side, plan: EgmPlan, heard: UdpServer) -> Rehearsal:
    """The stand-in has boxes of its own: nobody looks into them."""
    socket = UdpServer("127.0.0.1", 0)
    boxes = {each: ArmBoxes() for each in Side}
    return Rehearsal(heard, socket, *_parts_of_arm(side, plan, boxes, socket), SystemClock())


def _parts_of_arm(
    side: Side,
    plan: EgmPlan,
    boxes: Mapping[Side, ArmBoxes],
    socket: UdpServer,
    stations: StationClock | None = None,
    speed: SpeedScale | None = None,
) -> tuple[EgmArm, ControllerManager, Guard]:
    manager = _manager_of(side, boxes, plan.limits, plan.period, speed)
    start_controllers(manager, plan.controllers[side])
    session = SensorSession(JointCodec(), silence=plan.silence)
    return EgmArm(socket, session, stations), manager, Guard(plan.limits, plan.period, plan.position_gain)


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
        plan: where the fast lines listen.
        fast_lines: both arms'.
        manager: the robot's state.
        signals: what the controller tells of the hands.
        grippers: the hands.
    """

    client: RwsClient
    bringup: Bringup
    plan: EgmPlan
    fast_lines: FastLines
    manager: RobotManager
    signals: GripperSignals
    grippers: Mapping[Side, Gripper]


def make_parts(
    settings: Settings,
    controllers: Controllers,
    on_event: Callable[[Event], None],
    report: Callable[[str], None],
    leading: str = POSITION_CONTROLLER,
    arms: tuple[Side, ...] = tuple(Side),
    warn: Callable[[str], None] | None = None,
    stops: StopLog | None = None,
) -> DriverParts:
    """The parts for the robot of ``settings``.

    Args:
        settings: where it is, and how it shall move.
        controllers: what runs on each arm.
        on_event: told what happens in a fast line.
        report: told each step of what is done to the robot.
        leading: the controller that commands an arm after EGM has started.
        arms: those that are guided; the others stand still.
        warn: told what is not as it should be; None: ``report`` is.
        stops: what stopped the robot, where an earlier connection knows it already.

    Raises:
        NoConnection: there is no way to the robot's address.
        SettingsError: a controller has an unknown type, or parameters it cannot have.
    """
    clock, robot, plan = SystemClock(), settings.robot, plan_egm(settings, controllers)
    client = RwsClient(
        f"{robot.address}:{robot.rws_port}", user=robot.user, password=robot.password, timeout=robot.timeout
    )
    fast_lines = FastLines(partial(build_arm, plan), on_event, settings.egm.wake)
    boxes = {side: each.speed_scale for side, each in fast_lines.boxes.items()}
    speed = SpeedSetting(first_speed_scale(settings), boxes, lambda side: fast_lines.snapshot(side).is_running)
    bringup = Bringup(client, settings.egm_motion, clock, report, arms, warn, speed)
    manager = RobotManager(bringup, fast_lines, clock, leading, arms, settings.watchdog, stops, settings.recovery)
    signals = GripperSignals(client, {side: settings.gripper.modules(side) for side in Side})
    grippers = build_grippers(client, clock, settings, signals)
    manager.grippers = tuple(grippers.values())
    return DriverParts(client, bringup, plan, fast_lines, manager, signals, grippers)


def only_at_robot(settings: Settings) -> Only:
    """What makes sure that one program of this machine drives the robot of ``settings``."""
    address = f"{resolve(settings.robot.address)}:{settings.robot.rws_port}"
    refusal = f"The robot at {address} is driven by another program ({{owner}}); end it first."
    return Only(f"yumi-drives-{address}", refusal)


def build_grippers(
    client: RwsClient, clock: Clock, settings: Settings, signals: GripperSignals | None = None
) -> dict[Side, Gripper]:
    """Both hands of a connected robot; without ``signals`` they ask for everything."""
    routines, own = GripperRoutines(client, clock), settings.gripper
    return {
        side: Gripper(side, client, routines, clock, own.timeout, own.speed, own.modules(side), signals)
        for side in Side
    }
