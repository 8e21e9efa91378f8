"""The wiring plan: which objects, threads and processes make up the driver and the virtual controller.

::

    yumi up          process 1     RWS client, robot manager, grippers, ROS nodes
                                   threads: executor, streams, joint-states-r, joint-states-l, fingers,
                                            fast-line-events (two), flight-records (when something stops),
                                            full-recorder (--record)
                     process 2, 3  the fast lines: one arm's cycles each, one thread
    yumi controller  one process the world (main thread) and the HTTP server (one thread), under one lock
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from math import radians
from pathlib import Path
from threading import Event as Flag
from threading import Lock
from typing import TYPE_CHECKING

from yumi.clock import Clock, SystemClock
from yumi.control.arm_line import ArmLine
from yumi.control.controller import Controller
from yumi.control.flight_recorder import FlightRecorder
from yumi.control.guard import Guard
from yumi.control.manager import ControllerManager
from yumi.control.point_motion import slower
from yumi.control.requests import Event
from yumi.control.stations import StationClock
from yumi.controllers.dual_arm_trajectory import DualArmTrajectoryController
from yumi.controllers.joint_position import JointPositionController
from yumi.controllers.joint_state_broadcaster import JointStateBroadcaster
from yumi.controllers.joint_trajectory import JointTrajectoryController
from yumi.egm.joint_codec import JointCodec
from yumi.egm.session import SensorSession
from yumi.errors import YumiError
from yumi.evaluation.records import Records
from yumi.hardware.bringup import Bringup
from yumi.hardware.egm_arm import EgmArm
from yumi.hardware.fast_line import ArmBoxes, WiredArm
from yumi.hardware.fast_lines import FastLines
from yumi.hardware.gripper import Gripper, GripperRoutines
from yumi.hardware.rehearsal import Rehearsal
from yumi.hardware.rws_client import RwsClient
from yumi.initial_controllers import start_controllers
from yumi.links.http import HttpReply, HttpRequest
from yumi.links.http_server import HttpServer
from yumi.links.only import Only
from yumi.links.realtime import prefer_process
from yumi.links.udp import UdpClient, UdpServer, address_towards, resolve
from yumi.robot.cycle import CYCLE
from yumi.robot.joints import Side, joint_names
from yumi.robot.limits import YUMI_LIMITS
from yumi.settings import ControllerSettings, Settings
from yumi.virtual.gripper import Workpiece
from yumi.virtual.rws_adapter import RwsAdapter
from yumi.virtual.world import World, WorldSettings

if TYPE_CHECKING:
    from yumi.ros.robot_manager import RobotManager

Controllers = Mapping[Side, tuple[ControllerSettings, ...]]


@dataclass(frozen=True, slots=True)
class Place:
    """Where a controller is made, in the fast line: what it may be given.

    Attributes:
        name: the controller's name.
        side: its arm.
        boxes: what its arm shares with the other processes.
        partner: what the other arm shares with them.
    """

    name: str
    side: Side
    boxes: ArmBoxes
    partner: ArmBoxes


CONTROLLER_KINDS: Mapping[str, Callable[[Place], Controller]] = {
    JointStateBroadcaster.kind: lambda place: JointStateBroadcaster(place.boxes.states),
    JointPositionController.kind: lambda place: JointPositionController(place.boxes.goals),
    JointTrajectoryController.kind: lambda place: JointTrajectoryController(place.side, place.boxes.trajectory),
    DualArmTrajectoryController.kind: lambda place: DualArmTrajectoryController(
        place.side, place.boxes.dual_trajectory, place.boxes.dual_status, place.partner.dual_status
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
    """

    listen: str
    remote: str
    ports: Mapping[Side, int]
    silence: float
    period: float
    controllers: Controllers


def plan_egm(settings: Settings, controllers: Controllers) -> EgmPlan:
    """Where to listen for the robot of ``settings``.

    Raises:
        NoConnection: there is no way to the robot's address.
        SettingsError: a controller has an unknown type, or parameters it cannot have.
    """
    remote = resolve(settings.robot.address)
    listen = address_towards(remote) if settings.egm.listen == "auto" else settings.egm.listen
    ports = {side: settings.egm.port(side) for side in Side}
    period = settings.egm_motion.sample_rate * 1e-3
    return EgmPlan(listen, remote, ports, settings.egm.silence, period, check_controllers(controllers))


def check_controllers(controllers: Controllers) -> Controllers:
    """``controllers`` as the fast line can start them: tried out, and without what stands under a wildcard for others.

    Raises:
        SettingsError: a controller has an unknown type, a parameter it cannot have, or a state it cannot start in.
    """
    boxes = {side: ArmBoxes() for side in Side}
    return {side: start_controllers(_manager_of(side, boxes), entries) for side, entries in controllers.items()}


def _manager_of(side: Side, boxes: Mapping[Side, ArmBoxes]) -> ControllerManager:
    def factory(make: Callable[[Place], Controller]) -> Callable[[str], Controller]:
        return lambda name: make(Place(name, side, boxes[side], boxes[side.other]))

    kinds = {kind: factory(make) for kind, make in CONTROLLER_KINDS.items()}
    return ControllerManager(joint_names(side), kinds, side.unit, time.monotonic)


def build_arm(plan: EgmPlan, side: Side, boxes: Mapping[Side, ArmBoxes]) -> WiredArm:
    """An arm of the fast line, with the controllers that only watch already active."""
    socket = UdpServer(plan.listen, plan.ports[side], remote=plan.remote)
    stations = StationClock(time.monotonic)
    arm, manager, guard = _parts_of_arm(side, plan, boxes, socket, stations)
    own = boxes[side]
    line = ArmLine(side, arm, manager, guard, own.snapshots, FlightRecorder(own.flight), stations, plan.period)
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
) -> tuple[EgmArm, ControllerManager, Guard]:
    manager = _manager_of(side, boxes)
    start_controllers(manager, plan.controllers[side])
    session = SensorSession(JointCodec(), silence=plan.silence)
    return EgmArm(socket, session, stations), manager, Guard(YUMI_LIMITS, plan.period)


def run_driver(
    settings: Settings,
    controllers: Controllers,
    is_over: Flag,
    on_ready: Callable[[], None],
    record: Path | None = None,
) -> None:
    """The driver: connect, bring the robot to ready, serve ROS until ``is_over``; leaves the robot without EGM.

    Args:
        settings: where the robot is, and how it shall move.
        controllers: what runs on each arm.
        is_over: set when it shall end.
        on_ready: called when ROS is served and the robot was brought to ready, or said why not.
        record: file for every cycle of both arms.

    Raises:
        YumiError: the robot cannot be reached or used; nothing was started.
    """
    from yumi.ros.driver import RosDriver, close_ros, open_ros  # noqa: PLC0415 - yumi works without ROS
    from yumi.ros.robot_manager import RobotManager  # noqa: PLC0415

    clock = SystemClock()
    robot = settings.robot
    with RwsClient(
        f"{robot.address}:{robot.rws_port}", user=robot.user, password=robot.password, timeout=robot.timeout
    ) as client:
        bringup = Bringup(client, settings.egm_motion, clock, lambda step: ros.say(f"Bring-up: {step}"))
        bringup.check_controller()
        plan = plan_egm(settings, controllers)

        def on_event(event: Event) -> None:
            records.note(event, clock.now(), time.time())
            ros.tell(event)

        fast_lines = FastLines(partial(build_arm, plan), on_event, settings.egm.wake)
        manager = RobotManager(bringup, fast_lines, clock)
        grippers = _grippers(client, clock, settings)
        with ExitStack() as stack:
            only = Only(f"yumi-driver-in-ros-domain-{os.environ.get('ROS_DOMAIN_ID', '0')}")
            only.claim()
            stack.callback(only.release)
            open_ros()
            stack.callback(close_ros)
            force, rate = settings.gripper.force, settings.ros.merged_rate
            limits = slower(YUMI_LIMITS, top_speed=radians(settings.egm_motion.max_speed_deviation))
            ros = RosDriver(fast_lines, plan.controllers, manager, grippers, force, rate, clock, limits)
            stack.callback(ros.stop)
            records = Records(settings.recorder, fast_lines.recorders, ros.say)
            stack.callback(records.close)
            if record:
                records.record_all(record, time.time() - clock.now())
            fast_lines.start()
            stack.callback(fast_lines.stop)
            stack.callback(_end_motion, manager, ros.say)
            ros.start()
            ros.say(f"Connected to {client.address}. {fast_lines.started_as}")
            ros.make_ready()
            on_ready()
            is_over.wait()


def _grippers(client: RwsClient, clock: Clock, settings: Settings) -> dict[Side, Gripper]:
    routines = GripperRoutines(client, clock)
    return {side: Gripper(side, client, routines, clock, settings.gripper.timeout) for side in Side}


def _end_motion(manager: RobotManager, say: Callable[[str], None]) -> None:
    try:
        manager.end_motion()
    except YumiError as error:
        say(f"The robot could not be told to end EGM: {error}")


def world_settings(
    *, robot_name: str, egm_host: str, egm_ports: Mapping[Side, int], objects: Mapping[Side, float | None]
) -> WorldSettings:
    """A virtual robot whose clock shows the time of day.

    Args:
        robot_name: name of the controller's system.
        egm_host: where the arms send their datagrams.
        egm_ports: UDP port per arm.
        objects: width of what lies between each arm's fingers [m]; None for nothing.
    """
    workpieces = {side: Workpiece(width) for side, width in objects.items() if width is not None}
    return WorldSettings(
        robot_name=robot_name, egm_host=egm_host, egm_ports=egm_ports, workpieces=workpieces, start_time=time.time()
    )


class VirtualController:
    """A virtual IRC5 on the network: RWS over HTTP, EGM over UDP, advancing in real time.

    Args:
        settings: what the virtual robot is like.
        rws_port: port of the HTTP server, 0 for any.
        user: user name that may log in.
        password: its password.
        host: address to listen on.
    """

    def __init__(self, settings: WorldSettings, *, rws_port: int, user: str, password: str, host: str) -> None:
        self._clock = SystemClock()
        self._lock = Lock()
        self.world = World(settings)
        self._adapter = RwsAdapter(self.world.controller, user=user, password=password)
        self._server = HttpServer(self._handle, host=host, port=rws_port)
        self._links = {side: UdpClient(*self.world.egm_destination(side)) for side in Side}

    def run(self, is_over: Flag, on_ready: Callable[[int], None]) -> None:
        """Serve until ``is_over``; ``on_ready`` is told the HTTP port.

        Raises:
            NoConnection: the port is taken.
        """
        prefer_process()
        with self._server as server:
            on_ready(server.port)
            due = self._clock.now()
            while not is_over.is_set():
                self._cycle()
                due = self._wait_until(due + CYCLE)
        for link in self._links.values():
            link.close()

    def _cycle(self) -> None:
        inboxes = {side: link.receive() for side, link in self._links.items()}
        with self._lock:
            datagrams = self.world.cycle(inboxes)
        for side, datagram in datagrams.items():
            self._links[side].send(datagram)

    def _wait_until(self, due: float) -> float:
        """Wait; a machine that has fallen behind by more than a few cycles lets them go, as time does."""
        now = self._clock.now()
        if due > now:
            self._clock.wait(due - now)
            return due
        return due if now - due < 5 * CYCLE else now

    def _handle(self, request: HttpRequest) -> HttpReply:
        with self._lock:
            return self._adapter.handle(request, self._clock.now())
