"""The whole system without sockets and without real time: waiting is what makes the virtual robot go on."""

from __future__ import annotations

from collections.abc import Callable

from memory_http import MemoryHttp
from yumi.clock import ManualClock
from yumi.control.arm_line import ArmLine
from yumi.control.flight_recorder import FlightRecorder, flight_memory
from yumi.control.goals import put_goal
from yumi.control.guard import Guard
from yumi.control.mailbox import MemoryMailbox
from yumi.control.manager import ControllerManager
from yumi.control.requests import Event
from yumi.control.snapshot import Snapshot, peek_snapshot
from yumi.control.stations import StationClock
from yumi.controllers.joint_position import JointPositionController
from yumi.egm.joint_codec import JointCodec
from yumi.egm.session import SensorSession
from yumi.hardware.bringup import Bringup
from yumi.hardware.egm_arm import EgmArm
from yumi.hardware.gripper import Gripper, GripperRoutines
from yumi.hardware.rws_client import RwsClient
from yumi.hardware.state_machine import EgmMotionSettings
from yumi.links.memory import MemoryLink, memory_links
from yumi.robot.cycle import CYCLE
from yumi.robot.joints import Joints, Side, joint_names
from yumi.robot.limits import YUMI_LIMITS
from yumi.virtual.gripper import Workpiece
from yumi.virtual.world import World, WorldSettings

CONTROLLER = "joint_position_controller"


class DriverArm:
    """One arm of the fast line on a wire in memory."""

    def __init__(self, side: Side, link: MemoryLink) -> None:
        self.goals = MemoryMailbox()
        self.snapshots = MemoryMailbox()
        self.admitted: list[Joints] = []
        self.measured: list[Joints] = []
        self.events: list[Event] = []
        manager = ControllerManager(joint_names(side))
        manager.load(CONTROLLER, JointPositionController(self.goals))
        manager.configure(CONTROLLER)
        session = SensorSession(JointCodec())
        self.recorder = FlightRecorder(flight_memory())
        stations = StationClock()
        self.line = ArmLine(
            side, EgmArm(link, session, stations), manager, Guard(YUMI_LIMITS), self.snapshots, self.recorder, stations
        )

    def advance(self, now: float) -> None:
        cycle = self.line.run(now)
        if cycle is not None:
            self.admitted.append(cycle.admitted.position)
            self.measured.append(cycle.state.position)
        self.line.watch_silence(now)
        self.events += self.line.take_events()

    @property
    def snapshot(self) -> Snapshot:
        return peek_snapshot(self.snapshots)

    def activate(self) -> None:
        self.line.manager.switch([CONTROLLER], [], self.line.state)

    def go(self, goal: Joints) -> None:
        put_goal(self.goals, self.snapshot.session, goal)


class System(ManualClock):
    """World, wire and driver; the clock of everything.

    Attributes:
        is_powered: whether the controller runs; set it to False for a power cut.
    """

    def __init__(self, *, object_width: float = 0.02) -> None:
        super().__init__()
        self.is_powered = True
        self.world = World(WorldSettings(workpieces={Side.LEFT: Workpiece(object_width)}))
        ends = {side: memory_links() for side in Side}
        self._robot_ends = {side: ends[side][1] for side in Side}
        self.arms = {side: DriverArm(side, ends[side][0]) for side in Side}
        self.http = MemoryHttp(self.world.controller, self)
        self.client = RwsClient(self.http, clock=self)
        self.steps: list[str] = []
        self.bringup = Bringup(self.client, EgmMotionSettings(), self, self.steps.append)
        routines = GripperRoutines(self.client, self)
        self.grippers = {side: Gripper(side, self.client, routines, self, 10.0) for side in Side}

    def wait(self, seconds: float) -> None:
        """Let the world go on, a cycle at a time."""
        for _ in range(max(1, round(seconds / CYCLE))):
            self._cycle()

    def until(self, is_so: Callable[[], bool], timeout: float) -> float:
        """Let the world go on until ``is_so``; returns how long it took [s]."""
        begin = self.now()
        while not is_so():
            assert self.now() - begin < timeout, f"did not happen within {timeout} s"
            self.wait(CYCLE)
        return self.now() - begin

    def start_egm(self) -> None:
        self.bringup.make_ready()
        self.bringup.start_egm()
        self.until(lambda: all(arm.snapshot.is_running for arm in self.arms.values()), 1.0)
        for arm in self.arms.values():
            arm.activate()

    def _cycle(self) -> None:
        self.advance(CYCLE)
        if self.is_powered:
            datagrams = self.world.cycle({side: end.receive() for side, end in self._robot_ends.items()})
            for side, datagram in datagrams.items():
                self._robot_ends[side].send(datagram)
            self.http.advance()
        for arm in self.arms.values():
            arm.advance(self.now())
