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
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from ipaddress import ip_address
from math import radians
from pathlib import Path
from threading import Event as Flag
from threading import Thread
from typing import NamedTuple

from yumi.clock import Clock, SystemClock
from yumi.control.arm_line import ArmLine
from yumi.control.controller import Controller
from yumi.control.feed_forward import EGM_GAIN
from yumi.control.flight_recorder import FlightRecorder
from yumi.control.guard import Guard
from yumi.control.manager import ControllerManager
from yumi.control.requests import Event, HoldArm
from yumi.control.speed_scale import FULL, SpeedScale
from yumi.control.stations import StationClock
from yumi.controllers.dual_arm_trajectory import DualArmTrajectoryController
from yumi.controllers.forward_command import FORWARDERS, ForwardCommandController
from yumi.controllers.joint_goal import JointGoalController
from yumi.controllers.joint_position import JointPositionController
from yumi.controllers.joint_state_broadcaster import JointStateBroadcaster
from yumi.controllers.joint_trajectory import JointTrajectoryController
from yumi.controllers.joint_velocity import JointVelocityController
from yumi.egm.joint_codec import JointCodec
from yumi.egm.session import SensorSession
from yumi.errors import YumiError
from yumi.evaluation.records import Records
from yumi.hardware.bringup import Bringup
from yumi.hardware.connection import RobotConnection
from yumi.hardware.egm_arm import EgmArm
from yumi.hardware.fast_line import ArmBoxes, WiredArm
from yumi.hardware.fast_lines import FastLines
from yumi.hardware.gripper import Gripper
from yumi.hardware.gripper_routines import GripperRoutines
from yumi.hardware.hand_io import HandIo
from yumi.hardware.hand_signals import HandSignals
from yumi.hardware.launch_checks import EgmAddress
from yumi.hardware.rehearsal import Rehearsal
from yumi.hardware.robot_manager import POSITION_CONTROLLER, RobotManager
from yumi.hardware.rws_client import RwsClient
from yumi.hardware.speed_setting import FIRST_CONTACT, SpeedSetting
from yumi.hardware.stops import StopLog
from yumi.initial_controllers import start_controllers
from yumi.links.only import Only
from yumi.links.realtime import brisk_threads, release_process, settle_memory
from yumi.links.supervision import start_thread
from yumi.links.udp import UdpServer, address_towards, resolve
from yumi.robot.cycle import CYCLE
from yumi.robot.joints import Side, joint_names
from yumi.robot.limits import YUMI_LIMITS, JointLimits
from yumi.settings import ControllerSettings, Settings

Controllers = Mapping[Side, tuple[ControllerSettings, ...]]

TELL_CONTROLLER = 3.0
"""A driver that is to end gives up telling the controller after this time [s]: the network may be dead."""

END = 4.5
"""A driver that has not ended this long after it was asked to is ended by force [s]."""

_GLANCE = 0.05  # [s]


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
    signals: HandSignals
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
    signals = HandSignals(client, {side: settings.gripper.modules(side) for side in Side})
    grippers = build_grippers(client, clock, settings, signals)
    manager.grippers = tuple(grippers.values())
    return DriverParts(client, bringup, plan, fast_lines, manager, signals, grippers)


def run_driver(
    settings: Settings,
    controllers: Controllers,
    is_over: Flag,
    on_ready: Callable[[str], None],
    record: Path | None = None,
) -> None:
    """The driver: connect, bring the robot to ready, serve ROS until ``is_over``; leaves the robot without EGM.

    Without ``ros.autostart`` it only serves ROS: connecting and what follows are left to who leads its managed nodes.
    Without ``ros.bringup`` it connects and reads, and changes nothing on the robot until it is asked to.

    Args:
        settings: where the robot is, and how it shall move.
        controllers: what runs on each arm.
        is_over: set when it shall end.
        on_ready: called when ROS is served and the robot was brought to ready; told why it is not, or nothing.
        record: file for every cycle of both arms.

    Raises:
        YumiError: the robot cannot be reached or used; nothing was started.
    """
    from yumi.ros.driver import RosDriver, close_ros, open_ros  # noqa: PLC0415 - yumi works without ROS
    from yumi.ros.hands import HandParts  # noqa: PLC0415

    clock = SystemClock()

    def on_event(event: Event) -> None:
        records.note(event, clock.now(), time.time())
        parts.manager.note(event)
        ros.tell(event)

    with brisk_threads(), ExitStack() as stack:
        stack.callback(release_process)
        for only in (_only_in_ros_domain(), only_at_robot(settings)):
            only.claim()
            stack.callback(only.release)
        parts = make_parts(
            settings,
            controllers,
            on_event,
            lambda step: ros.say(f"Bring-up: {step}"),
            warn=lambda remark: ros.warn(f"Bring-up: {remark}"),
        )
        stack.enter_context(_ending_in_time(parts.client, parts.manager, is_over))
        stack.callback(parts.client.close)
        connection = _connection_of(parts)
        if settings.ros.autostart:
            connection.check()
        hands = HandParts(parts.grippers, parts.signals, settings.gripper)
        open_ros()
        stack.callback(close_ros)
        fast_lines, manager, plan, rate = parts.fast_lines, parts.manager, parts.plan, settings.ros.merged_rate
        ros = RosDriver(fast_lines, plan.controllers, manager, connection, hands, rate, clock, plan.limits)
        stack.callback(ros.stop)
        records = Records(settings.recorder, fast_lines.recorders, ros.say)
        stack.callback(records.close)
        if record:
            records.record_all(record, time.time() - clock.now())
        manager.watch.reports.report = ros.report
        fast_lines.start()
        stack.callback(fast_lines.stop)
        stack.callback(connection.disconnect)
        stack.callback(_end_motion, manager, fast_lines, connection, ros.say)
        ros.start()
        ros.say(fast_lines.started_as)
        ros.say(f"{manager.speed} Change it with yumi_robot_manager/set_speed_scale or the setting robot.speed_scale.")
        reason = ros.bring_up(is_reading_only=not settings.ros.bringup) if settings.ros.autostart else ""
        settle_memory()
        on_ready(reason)
        is_over.wait()


def _connection_of(parts: DriverParts) -> RobotConnection:
    check = partial(parts.bringup.check_controller, parts.plan.addresses)
    return RobotConnection(parts.client, check, parts.manager, parts.signals.close)


def _only_in_ros_domain() -> Only:
    return Only(
        f"yumi-driver-in-ros-domain-{os.environ.get('ROS_DOMAIN_ID', '0')}",
        "Another driver runs on this machine in the same ROS domain ({owner}); stop it or give one of the two its own "
        "ROS_DOMAIN_ID.",
    )


def only_at_robot(settings: Settings) -> Only:
    """What makes sure that one program of this machine drives the robot of ``settings``."""
    address = f"{resolve(settings.robot.address)}:{settings.robot.rws_port}"
    refusal = f"The robot at {address} is driven by another program ({{owner}}); end it first."
    return Only(f"yumi-drives-{address}", refusal)


def build_grippers(
    client: RwsClient, clock: Clock, settings: Settings, signals: HandSignals | None = None
) -> dict[Side, Gripper]:
    """Both hands of a connected robot; without ``signals`` they ask for everything."""
    routines, own = GripperRoutines(client, clock), settings.gripper
    return {
        side: Gripper(HandIo(side, client, signals, own.modules(side)), routines, clock, own.timeout, own.speed)
        for side in Side
    }


@contextmanager
def _ending_in_time(client: RwsClient, manager: RobotManager, is_over: Flag) -> Iterator[None]:
    """Once ``is_over``, what is being done to the robot ends at its next step, and the controller is soon given up."""
    has_ended = Flag()

    def watch() -> None:
        while not is_over.wait(_GLANCE):
            if has_ended.is_set():
                return
        manager.give_way()
        if not has_ended.wait(TELL_CONTROLLER):
            client.abandon()

    thread = Thread(target=watch, name="end-in-time", daemon=True)
    start_thread(thread)
    try:
        yield
    finally:
        has_ended.set()
        thread.join()


def _end_motion(
    manager: RobotManager, fast_lines: FastLines, connection: RobotConnection, say: Callable[[str], None]
) -> None:
    """Hold the arms, whatever the network does, and have the controller end EGM, if it can be told."""
    for side in Side:
        if fast_lines.snapshot(side).is_commanded:
            with suppress(YumiError):  # a fast line that is gone: the other arm is held all the same
                fast_lines.ask(HoldArm(side))
    try:
        if connection.is_open and manager.has_acted:  # else EGM, if it runs, is another program's
            manager.end_motion()
    except YumiError as error:
        say(f"The robot could not be told to end EGM: {error}")


def end_by_force(is_over: Flag) -> None:
    """End the process :data:`END` after ``is_over`` is set, should it still be there; the arms' processes hold then.

    Something may wait for what never comes: a user who has asked the driver to end needs no other program for it.
    """

    def end() -> None:
        is_over.wait()
        time.sleep(END)
        busy = [each.name for each in threading.enumerate() if not each.daemon and each is not threading.main_thread()]
        words = f"; these threads had not ended: {', '.join(sorted(busy))}" if busy else ""
        sys.stderr.write(f"Error: the driver did not end within {END:g} s and is ended by force{words}.\n")
        sys.stderr.flush()
        os._exit(1)

    start_thread(Thread(target=end, name="forced-end", daemon=True))
