"""The whole system without sockets and without real time: waiting is what makes the virtual robot go on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Concatenate, ParamSpec, TypeVar

from abb_protocols.robot.gripper_values import GripperModules
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Joints, Side, joint_names
from abb_runtime.clock import ManualClock
from abb_runtime.rws.client import RwsClient
from abb_runtime.udp import MemoryLink, memory_links
from memory_http import MemoryHttp
from virtual_irc5.fault_injection import FaultInjection
from virtual_irc5.mechanics.virtual_gripper import Workpiece
from virtual_irc5.world import World, WorldSettings
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.flight_recorder import FlightRecorder, flight_memory
from yumi.control.goals import MemoryBuffer, write_goal
from yumi.control.hand_over import HandOver
from yumi.control.limiter import Limiter
from yumi.control.loop import ArmLoop
from yumi.control.loop_commands import Commands, serve
from yumi.control.loop_events import Event
from yumi.control.manager.controller_manager import ControllerManager
from yumi.control.motion.robot_response import STANDING
from yumi.control.shared_state import Snapshot, read_snapshot
from yumi.control.speed_scale import SpeedScale
from yumi.control.stage_times import StageClock
from yumi.driver.bringup import Bringup
from yumi.driver.egm_arm import EgmArm
from yumi.driver.gripper import GripperRoutines, RwsGripper
from yumi.driver.gripper_signals import GripperSignals
from yumi.driver.robot_manager import RobotManager
from yumi.driver.speed_setting import SpeedSetting
from yumi.driver.state_machine import EgmMotionSettings
from yumi.egm.egm_session import Session

CONTROLLER = "joint_position_controller"

P = ParamSpec("P")
T = TypeVar("T")


class DriverArm:
    """One arm of the fast line on a wire in memory."""

    def __init__(self, side: Side, link: MemoryLink) -> None:
        self.goals = MemoryBuffer()
        self.speed_scale = MemoryBuffer()
        self.snapshots = MemoryBuffer()
        self.deadline = MemoryBuffer()
        self.admitted: list[Joints] = []
        self.measured: list[Joints] = []
        self.events: list[Event] = []
        manager = ControllerManager(joint_names(side))
        speed = SpeedScale(self.speed_scale)
        manager.load(CONTROLLER, JointPositionController(self.goals, speed=speed))
        manager.configure(CONTROLLER)
        limiter = Limiter(YUMI_LIMITS)
        self.recorder = FlightRecorder(flight_memory())
        stages = StageClock()
        self.line = ArmLoop(
            side,
            EgmArm(link, Session(), limiter),
            manager,
            limiter,
            self.snapshots,
            self.recorder,
            stages,
            speed=speed,
            deadline=self.deadline,
        )

    def advance(self, now: float) -> Sequence[Event]:
        cycle = self.line.run(now)
        if cycle is not None:
            self.admitted.append(cycle.sent.position)
            self.measured.append(cycle.state.position)
        self.line.watch_silence(now)
        events = self.line.take_events()
        self.events += events
        return events

    @property
    def snapshot(self) -> Snapshot:
        return read_snapshot(self.snapshots)

    def activate(self) -> None:
        self.line.manager.switch([CONTROLLER], [], self.line.state)

    def go(self, goal: Joints) -> None:
        write_goal(self.goals, self.snapshot.session, goal)


class MemoryControl:
    """The control process of both arms, in this process."""

    def __init__(self, arms: Mapping[Side, DriverArm], clock: ManualClock) -> None:
        self._arms = arms
        self._commands = Commands({side: arm.line for side, arm in arms.items()}, clock.now)
        self.hand_over = HandOver(clock.now, self._is_busy)

    def check(self) -> None:
        """It runs."""

    def revive(self) -> bool:
        return False

    def snapshot(self, side: Side) -> Snapshot:
        return self._arms[side].snapshot

    def call(self, command: Callable[Concatenate[Commands, P], T], /, *args: P.args, **kwargs: P.kwargs) -> T:
        with self.hand_over.passing(command, args, kwargs):
            return serve(self._commands, command, *args, **kwargs)

    def _is_busy(self, side: Side) -> bool:
        snapshot = self.snapshot(side)
        return snapshot.is_on_way or max(map(abs, snapshot.velocity)) > STANDING


class System(ManualClock):
    """World, wire and driver; the clock of everything.

    Attributes:
        faults: what may happen to it.
        signals: of both hands; the hands are asked until it is opened.
        is_powered: whether the controller runs; set it to False for a power cut.
        stands_still: whether the driver does not run, while the robot goes on.
        is_cut: whether no datagram arrives, while the robot goes on.
        gives_signs: whether somebody gives the robot's watchdog its signs.
        faults: what may happen to the controller.
    """

    def __init__(
        self,
        *,
        object_width: float = 0.02,
        modules: GripperModules = GripperModules.TWO_VACUUMS,
        are_calibrated: bool = False,
        motion: EgmMotionSettings | None = None,
        request_interval: float = 0.0,
    ) -> None:
        super().__init__()
        self.is_powered = True
        self.stands_still = self.is_cut = False
        self.gives_signs = False
        workpieces = {Side.LEFT: Workpiece(object_width)}
        both = dict.fromkeys(Side, modules)
        self.world = World(
            WorldSettings(workpieces=workpieces, gripper_modules=both, grippers_are_calibrated=are_calibrated)
        )
        ends = {side: memory_links() for side in Side}
        self._robot_ends = {side: ends[side][1] for side in Side}
        self._driver_ends = {side: ends[side][0] for side in Side}
        self.http = MemoryHttp(self.world.controller, self, request_interval)
        self.adapter = self.http.adapter
        self.faults = FaultInjection(self.world, self.adapter)
        self.client = RwsClient(self.http, clock=self)
        self.steps: list[str] = []
        self._motion = motion or EgmMotionSettings()
        self.grippers: dict[Side, RwsGripper] = {}
        self.start_driver()
        routines = GripperRoutines(self.client, self)
        self.signals = GripperSignals(self.client, both)
        self.grippers = {
            side: RwsGripper(side, self.client, routines, self, 10.0, modules=modules, signals=self.signals)
            for side in Side
        }
        self.manager.grippers = tuple(self.grippers.values())

    def start_driver(self) -> None:
        """A new driver in place of the old one, which nobody has told to end."""
        self.arms = {side: DriverArm(side, self._driver_ends[side]) for side in Side}
        self.control = MemoryControl(self.arms, self)
        buffers = {side: arm.speed_scale for side, arm in self.arms.items()}
        speed = SpeedSetting(1.0, buffers, lambda side: self.control.snapshot(side).is_running)
        self.bringup = Bringup(self.client, self._motion, self, self.steps.append, speed=speed)
        self.manager = RobotManager(self.bringup, self.control, self)
        self.manager.grippers = tuple(self.grippers.values())

    def wait(self, seconds: float) -> None:
        """Let the world go on, a cycle at a time."""
        for _ in range(max(1, round(seconds / CYCLE))):
            with self.http.lock:
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
        looks = dict.fromkeys(Side, 1)
        if self.gives_signs:
            self.world.controller.signals.set("WD_EXTERNAL_STATUS", 1)
        if self.is_powered:
            inboxes = {side: end.receive() for side, end in self._robot_ends.items()}
            departures = [each for each in self.world.exchange(inboxes) if not each.is_foreign]  # memory has no ports
            self.adapter.advance(self.now())
            for side, datagram, _ in departures:
                if not self.is_cut:
                    self._robot_ends[side].send(datagram)
            looks = {side: max(1, sum(each.side is side for each in departures)) for side in Side}
        if self.stands_still:
            return
        for side, arm in self.arms.items():
            for _ in range(looks[side]):  # the driver looks again while something waits
                for event in arm.advance(self.now()):
                    self.control.hand_over.note(event)
                    self.manager.note(event)
