"""What a script is connected to: a robot, whose driver it is then itself, or the driver that another program runs.

A :class:`Connection` opens the parts of a driver in one order, and closes them in the other. A :class:`RunningDriver`
looks and asks over the local endpoint of a driver, and drives nothing.
"""

from __future__ import annotations

import atexit
import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from functools import partial
from math import isfinite
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Literal, TypeVar

import msgspec

from yumi.api.arm_access import GOAL_CONTROLLER
from yumi.api.joint_positions import Position, checked_goal
from yumi.api.motion_executor import RETREAT_SPEED_SCALE, MotionExecutor
from yumi.api.motion_registry import MotionRegistry
from yumi.catalogue import Message, message, quoted
from yumi.clock import SystemClock
from yumi.control.loop_events import Event
from yumi.control.speed_scale import FULL
from yumi.driver import endpoint as wire
from yumi.driver.bringup import ANNOUNCEMENT
from yumi.driver.endpoint import (
    ControllerStatus,
    DriverState,
    EndpointClient,
    GripReport,
    MotionReport,
    Request,
    find_driver,
)
from yumi.driver.endpoint_server import DriverAccess, EndpointServer, surroundings_of
from yumi.driver.gripper import Gripper, GripperSetup, GripperSignals, close_as_test
from yumi.driver.readiness import Report, arms_in_words
from yumi.driver.robot_manager import RobotManager
from yumi.driver.settings import CalibrateWhen, Settings
from yumi.driver.state_machine import SpeedSetting
from yumi.driver.stops import StopLog
from yumi.driver.wiring import Controllers, make_parts, only_at_robot
from yumi.errors import CommandRefused, RobotNotReady, SettingsError, YumiError
from yumi.process.supervision import Failures
from yumi.recording.mcap import STATE, FullRecorder, Source, Sources
from yumi.robot.collision import TOOL_FRAME, Obstacle, Part
from yumi.robot.gripper import GripperModules
from yumi.robot.joints import JOINT_COUNT, YUMI_LIMITS, JointLimits, Pose, Side, joints

if TYPE_CHECKING:
    from yumi.planning.planner import Plan, Planner

log = logging.getLogger(__name__)
T = TypeVar("T")
Arms = wire.Arm | Sequence[wire.Arm]


def recorded_sources(manager: RobotManager, signals: GripperSignals) -> Sources:
    """What a recording of a session has beside the cycles: state, grippers, tools, and the arms without EGM."""
    manager.monitor.read_joints()
    values: dict[str, Source] = {STATE: manager.monitor.state}
    values |= {f"{side.value}/gripper": partial(signals.state, side) for side in Side}
    return Sources(values, manager.monitor.joints, manager.tcp)


class Connection:
    """A robot that is connected and ready, with EGM on its arms, from :meth:`open` to :meth:`close`.

    Args:
        settings: where the robot is, and how it moves.
        controllers: what runs on each arm.
        arms: those on which EGM runs; the others stand still.
        on_step: given each step of what is done to the robot.

    Attributes:
        executor: goals for the arms.
        grippers: of both arms.
        manager: the robot's readiness.
    """

    executor: MotionExecutor
    grippers: Mapping[Side, Gripper]
    manager: RobotManager

    def __init__(
        self,
        settings: Settings,
        controllers: Controllers,
        arms: tuple[Side, ...],
        on_step: Callable[[str], None] = lambda step: None,
    ) -> None:
        self._on_step = on_step
        self._settings = settings
        self._controllers = controllers
        self._arms = arms
        self._motions = MotionRegistry()
        self._stack = ExitStack()
        self._were_tested = False
        self._stops = StopLog(SystemClock())  # a stop that kept it from being opened is confirmed when it is opened
        self._speed: SpeedSetting | None = None
        self._note: Callable[[Event], None] = lambda event: None
        self._failures = Failures()

    def open(self, confirm: str = "") -> None:
        """Connect, bring the robot to ready, calibrate grippers that need it and start EGM on its arms.

        Args:
            confirm: id of the stop that a person has confirmed.

        Raises:
            StopNotConfirmed: a stop waits for a person's confirmation; everything is as before.
            YumiError: a step failed, the message says which; everything is as before.
        """
        with ExitStack() as stack:
            only = only_at_robot(self._settings)
            only.claim()
            stack.callback(only.release)
            self._start(stack)
            atexit.register(self.close)  # a notebook that is shut down ends its motions too
            stack.callback(atexit.unregister, self.close)
            stack.callback(self._end_motion)
            # As a warning, which a script without logging shows, too.
            is_tested = self._settings.gripper.test_at_start and not self._were_tested
            steps = [*self.manager.steps_to_ready(), *self._gripper_setup.steps(is_tested=is_tested)]
            start = f"start EGM on {arms_in_words(self._arms)} (to hold where they are)"
            log.warning("%s%s.", ANNOUNCEMENT, ", ".join([*steps, start]))
            self.manager.make_ready(confirm)
            if is_tested:  # not while EGM runs
                self._were_tested = True
                close_as_test(self.grippers, log.info, log.warning)
            self.manager.start_egm()
            stack.enter_context(self._endpoint())
            self._stack = stack.pop_all()

    @contextmanager
    def _endpoint(self) -> Iterator[None]:
        """Lets commands and other scripts see this robot, and ask for things."""
        access = DriverAccess(
            robot=f"{self._settings.robot.address}:{self._settings.robot.rws_port}",
            manager=self.manager,
            control=self._control,
            datagram=self.datagram,
            grippers=self.grippers,
            gripper_state=self._gripper_signals.state,
            force=self._settings.gripper.force,
            mover=self.executor,
            recover=self._recover_for_client,
            calibrate=self._calibrate_for_client,
            surroundings=msgspec.structs.replace(
                surroundings_of(self._settings), velocity=self.executor.limits.velocity
            ),
            joints=self.manager.monitor.joints,
            on_subscription=self.manager.monitor.read_joints,
        )
        server = EndpointServer(access, log.log)

        def report(level: int, said: Message | str) -> None:
            log.log(level, said)
            server.note(level, said)

        self.manager.monitor.log.report = report
        self._note = server.note_event
        server.start()
        try:
            yield
        finally:
            server.stop()

    def _recover_for_client(self, report: Report, check: Callable[[], None], confirm: str) -> str:
        self._control.check()  # another one can be started by the script alone, which has this endpoint, too
        return self.recover(confirm, report, check)

    def _calibrate_for_client(self, sides: Sequence[Side], check: Callable[[], None]) -> None:
        for side in sides:
            self.calibrate(side, check)

    def datagram(self, side: Side) -> bytes:
        """The newest datagram of an arm's robot."""
        return self._control.buffers[side].datagram.read()

    def _start(self, stack: ExitStack) -> None:
        """Make the parts of the driver, connect and start its processes and threads."""
        settings, warn = self._settings, partial(log.warning, "%s")

        def report(step: str) -> None:
            log.info("%s", step)
            self._on_step(step)

        for remark in settings.collision.remarks:
            log.info("%s", remark)
        parts = make_parts(
            settings, self._controllers, self._on_event, report, GOAL_CONTROLLER, self._arms, warn, self._stops
        )
        self.manager = manager = parts.manager
        self.grippers, self._control, self._gripper_signals = parts.grippers, parts.control, parts.signals
        self._gripper_setup = GripperSetup(
            parts.grippers,
            manager.step,
            log.warning,
            is_allowed=settings.gripper.calibrate is CalibrateWhen.AT_START,
            is_confirmed=lambda: not manager.is_unattended,
        )
        manager.when_ready(self._gripper_setup.run)
        if self._speed is not None:  # what was set before the connection was opened anew
            manager.speed.set(self._speed.value)
        self._speed = manager.speed
        if self._speed.value < FULL:
            log.warning("%s Raise it with robot.speed_scale or connect(speed_scale=...).", self._speed)
        self.client = parts.client
        stack.callback(parts.client.close)
        parts.control.launch()
        stack.callback(parts.control.stop)
        parts.client.connect()
        parts.bringup.check_controller(parts.plan.addresses)
        parts.control.start()
        stack.callback(parts.signals.close)
        try:
            parts.signals.keep_open()
        except YumiError as error:
            log.info("The controller grants no subscription to the grippers' signals, they are polled: %s", error)
        manager.monitor.log.report = log.log
        self._motions.explain = manager.monitor.explain
        manager.start()
        stack.callback(manager.stop)
        self.executor = MotionExecutor(
            parts.control,
            self._motions,
            self._arms,
            parts.plan.limits,
            SystemClock(),
            lambda: manager.speed.in_force,
            settings.tool_limits.limits,
        )

    def recover(self, confirm: str = "", report: Report | None = None, check: Callable[[], None] = lambda: None) -> str:
        """Bring the robot back to where it may move, after whatever stopped it.

        Args:
            confirm: id of the stop that a person has confirmed.
            report: gets each step before it is done.
            check: raises where it is not wanted any more.

        Returns:
            What had stopped it, and what it does now.

        Raises:
            StopNotConfirmed: a stop waits for a person's confirmation; nothing was changed.
            YumiError: a step failed; the message says which and what to do.
        """
        try:
            self._control.check()
        except RobotNotReady:
            self.close()
            self.open(confirm)
            done = "The robot was connected anew."
        else:
            self._come_to_rest()
            done = self.manager.recover(report or partial(log.info, "%s"), check, confirmed=confirm)
            log.info("%s", done)
            self.manager.start_egm(
                None, report or (lambda step: None), check
            )  # also where EGM had been ended by close(), or had not begun
        self._motions.clear_faults()
        return done

    def calibrate(self, side: Side, check: Callable[[], None] = lambda: None) -> None:
        """Close the fingers of a gripper and call that zero; EGM, during which that is impossible, is paused.

        It stays so where that fails: what made it fail may have stopped the robot, and :meth:`recover` is the way back.

        Raises:
            RobotNotReady: the gripper did not become calibrated, or EGM did not start again.
        """
        check()
        is_in_egm = side in self.manager.egm_arms
        if is_in_egm:
            self._end_motion()
        self.manager.calibrate(self.grippers[side], check=check)
        if is_in_egm:
            self.manager.start_egm()

    def record(self, file: Path) -> ExitStack:
        """Write every cycle of both arms, the grippers and the state to a file until what is returned is closed.

        Raises:
            SettingsError: the file cannot be written.
            MissingPrerequisite: mcap is not installed.
        """
        clock = SystemClock()
        begin, sources = time.time() - clock.now(), recorded_sources(self.manager, self._gripper_signals)
        try:
            recorder = FullRecorder(file, begin, self._control.recorders, partial(log.info, "%s"), clock, sources)
        except OSError as error:
            raise SettingsError(
                message("recording_not_writable", file=str(file), reason=error.strerror or str(error))
            ) from error
        recorder.start()
        end = ExitStack()
        end.callback(recorder.close)
        return end

    def close(self) -> None:
        """Let the arms come to rest, end EGM and give everything back; does nothing when that is done."""
        stack, self._stack = self._stack, ExitStack()
        stack.close()

    def _on_event(self, event: Event) -> None:
        what = f"Handling {type(event).__name__} of the {event.side.word} arm"
        for listener in (self.manager.note, self._motions.note, self._note):
            self._failures.attempt(what, listener, event)

    def _end_motion(self) -> None:
        self._come_to_rest()
        try:
            self.manager.end_motion()
        except YumiError as error:
            log.warning("EGM could not be ended on the robot: %s", error)

    def _come_to_rest(self) -> None:
        with suppress(YumiError):  # an arm that its controller cannot stop is held by the limiter
            self.executor.bring_to_rest(self._arms)


def attach(robot: str = "", *, on_step: Callable[[str], None] = lambda step: None) -> RunningDriver:
    """The driver that runs on this machine, of ``yumi up`` or of a script's ``yumi.connect``.

    ::

        with yumi.attach() as driver:
            print(driver.state.arms["right"].position)
            driver.move_to(right="home")

    Args:
        robot: its robot's address or its namespace, where several drivers run.
        on_step: given each step of what the driver does for this program.

    Raises:
        RobotNotReady: no driver runs, or several do; the message says what to do.
    """
    try:
        return RunningDriver(EndpointClient(find_driver(robot)), on_step)
    except YumiError as error:
        raise error.with_traceback(None) from None


class RunningDriver:
    """A running driver as another program sees it; one request at a time.

    Every method returns when it is done, and raises what the driver raised: a YumiError with its sentence.

    Args:
        client: the connection to it.
        on_step: given each step of what it does.
    """

    def __init__(self, client: EndpointClient, on_step: Callable[[str], None] = lambda step: None) -> None:
        self._client = client
        self._on_step = on_step
        self._planner: tuple[wire.Surroundings, Planner] | None = None  # of the last plan, and what it was made for

    def __enter__(self) -> RunningDriver:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<yumi.RunningDriver {self._client.path.stem}>"

    def close(self) -> None:
        """Disconnect; a motion that this program has asked for is stopped."""
        self._client.close()

    @property
    def state(self) -> DriverState:
        """All that the driver knows: robot, arms, controllers, grippers, the newest events."""
        return self._client.ask(wire.GetState(), DriverState)

    def watch(self, rate: float = 30.0) -> Iterator[DriverState]:
        """The state ``rate`` times a second (0.1 to 60), with the events since the one before.

        A connection that watches asks for nothing else: attach once more for that.
        """
        return self._client.watch(rate)

    @property
    def controllers(self) -> Mapping[str, tuple[ControllerStatus, ...]]:
        """The controllers of each arm."""
        return self._client.ask(wire.GetControllers(), dict[str, tuple[ControllerStatus, ...]])

    @property
    def speed_scale(self) -> float:
        """The factor on the speed of every controller; it can be set, 0.01 to 1."""
        return self.state.speed_scale

    @speed_scale.setter
    def speed_scale(self, value: float) -> None:
        self._ask(wire.SetSpeedScale(speed_scale=float(value)), str)

    def start_egm(self, arms: Arms = ()) -> str:
        """Start EGM on ``"right"``, ``"left"`` or the arms that are configured, with the controllers on top."""
        return self._ask(wire.StartEgm(arms=_arms(arms)), str)

    def stop_egm(self) -> str:
        """Bring the arms to rest and end EGM; waits for nothing else that the driver does."""
        return self._ask(wire.StopEgm(), str)

    def set_mode(self, mode: wire.ModeName) -> str:
        """Bring the robot to ``motors_off``, ``ready``, ``egm_left``, ``egm_right`` or ``egm_both``."""
        return self._ask(wire.SetMode(mode=mode), str)

    def recover(self, confirm: str = "") -> str:
        """Bring the robot back after a stop; ``confirm`` is ``state.stop``, after a person has looked at the robot."""
        return self._ask(wire.Recover(confirm=confirm), str)

    def calibrate(self, arms: Arms = ("right", "left")) -> str:
        """Close the fingers of grippers and call that zero."""
        return self._ask(wire.Calibrate(arms=_arms(arms)), str)

    def open_gripper(self, arm: wire.Arm, width: float | None = None) -> GripReport:
        """Open a gripper to ``width`` [m], or as far as it goes."""
        return self._ask(wire.Grip(arm=arm, action="open", width=width), GripReport)

    def close_gripper(self, arm: wire.Arm, force: float | None = None) -> GripReport:
        """Close a gripper and hold what is there with ``force`` [N]."""
        return self._ask(wire.Grip(arm=arm, action="close", force=force), GripReport)

    def switch(self, arm: wire.Arm, activate: Sequence[str] = (), deactivate: Sequence[str] = ()) -> str:
        """Activate and deactivate controllers of one arm in one step."""
        return self._ask(wire.SwitchControllers(arm=arm, activate=tuple(activate), deactivate=tuple(deactivate)), str)

    def move_to(
        self,
        *,
        right: Position | None = None,
        left: Position | None = None,
        speed_scale: float | None = None,
        acceleration: float | None = None,
        timeout: float | None = None,
        is_pose: bool = False,
        is_linear: bool = False,
        speed: float | None = None,
        on_motion: Callable[[dict[str, MotionReport]], None] = lambda motions: None,
    ) -> str:
        """Move arms, and return when they stand at their goals; the controllers that commanded them do so again then.

        A program that ends meanwhile, also by Ctrl-C, stops them.

        Args:
            right: joint positions [rad], (7,) in chain order; the name of a pose; or some joints by name, the others
                stay.
            left: the same of the left arm.
            speed_scale: factor on the joints' highest speeds, on top of the driver's, above 0 up to 1; None takes the
                controller's.
            acceleration: the same for accelerations and jerks.
            timeout: arms that take longer are stopped [s].
            is_pose: positions are poses of the tools in use instead: x, y, z [m], and w, x, y, z, or the orientation
                stays.
            is_linear: the tools move there on straight lines.
            speed: of the tools on lines, at most [m/s].
            on_motion: given how far the motions are, ten times a second.

        Raises:
            CommandRefused: a position is impossible, an arm moves already, or another program moves it.
            RobotNotReady: EGM does not run on the arm.
            GoalNotReached: a motion ended elsewhere.
        """
        goals = {
            side: _as_sent(position)
            for side, position in ((Side.RIGHT, right), (Side.LEFT, left))
            if position is not None
        }
        request = wire.Move(
            right=goals.get(Side.RIGHT),
            left=goals.get(Side.LEFT),
            speed_scale=speed_scale,
            acceleration=acceleration,
            timeout=timeout,
            is_pose=is_pose,
            is_linear=is_linear,
            speed=speed,
        )
        return self._client.ask(request, str, self._on_step, on_motion, timeout=None)

    def plan_to(
        self,
        *,
        right: Position | Pose | None = None,
        left: Position | Pose | None = None,
        timeout: float = 30.0,
        speed_scale: float = 1.0,
        seed: int = 0,
    ) -> Plan:
        """Plan a motion around the robot itself and the driver's boxes, in this program; nothing moves.

        Arguments and errors are those of :meth:`yumi.api.robot.Robot.plan_to`.
        """
        from yumi.planning.planner import Planner  # noqa: PLC0415 - an extra; nothing else needs it

        arms, start = self.state.arms, {}
        for side in Side:
            position = arms[side.word].position
            if position is None:
                raise RobotNotReady(message("plan_without_position", arm=side.word))
            start[side] = position
        surroundings = self._client.ask(wire.GetSurroundings(), wire.Surroundings)
        if self._planner is None or self._planner[0] != surroundings:
            grippers, tools, obstacles = shapes_of(surroundings)
            planner = Planner(grippers, tools=tools, obstacles=obstacles, limits=limits_of(surroundings))
            self._planner = surroundings, planner
        goals = {
            side: goal if isinstance(goal, Pose) else checked_goal(side, goal, start[side])
            for side, goal in ((Side.RIGHT, right), (Side.LEFT, left))
            if goal is not None
        }
        return self._planner[1].plan(start, goals, timeout=timeout, speed_scale=speed_scale, seed=seed)

    def execute(
        self, plan: Plan, *, on_motion: Callable[[dict[str, MotionReport]], None] = lambda motions: None
    ) -> str:
        """Have the arms follow a plan, and return when they stand at its end; raises as :meth:`move_to`.

        Both arms must be where they were when it was made.
        """
        paths = {side.word: tuple(map(tuple, points)) for side, points in plan.points.items()}
        start = {side.word: position for side, position in plan.start.items()}
        request = msgspec.convert({"method": "follow", "start": start, **paths}, wire.Follow)
        return self._client.ask(request, str, self._on_step, on_motion, timeout=None)

    def retreat(
        self,
        *,
        speed_scale: float = RETREAT_SPEED_SCALE,
        on_motion: Callable[[dict[str, MotionReport]], None] = lambda motions: None,
    ) -> str:
        """Lead both arms home on a planned path, slowly, as :meth:`yumi.api.robot.Robot.retreat`."""
        self._on_step("plan a path of both arms home")
        plan = self.plan_to(right="home", left="home", speed_scale=speed_scale)
        self._on_step(f"follow it, {plan.duration:.1f} s")
        return self.execute(plan, on_motion=on_motion)

    def allow_collision(self, part: str, other: str, *, seconds: float = 10.0) -> ExitStack:
        """Let two parts touch for a while, as :meth:`yumi.api.robot.Robot.allow_collision`, which raises the same.

        They are kept apart again, too, when this program disconnects or ends.
        """
        self._ask(wire.AllowCollision(part=part, other=other, seconds=float(seconds)), str)
        end = ExitStack()
        end.callback(lambda: self._ask(wire.AllowCollision(part=part, other=other, seconds=0.0), str))
        return end

    def jog(self, arm: wire.Arm, speeds: Sequence[float]) -> None:
        """Move an arm with joint speeds [rad/s], (7,) in chain order, for 0.06 s; call it again while it is to move.

        Raises:
            CommandRefused: the speeds are no seven finite numbers, or another client or motion moves the arm.
            RobotNotReady: EGM does not run on the arm.
        """
        values = _as_sent(speeds)
        if not isinstance(values, tuple) or len(values) != JOINT_COUNT:
            raise CommandRefused(message("jog_speeds_malformed", count=JOINT_COUNT, given=quoted(speeds)))
        self._ask(wire.Jog(arm=arm, speeds=joints(values)), str)

    def jog_tool(
        self,
        arm: wire.Arm,
        *,
        linear: Sequence[float] = (0.0, 0.0, 0.0),
        angular: Sequence[float] = (0.0, 0.0, 0.0),
        elbow: float = 0.0,
        frame: Literal["base", "tool"] = "base",
    ) -> None:
        """Move the fingertips of an arm with a velocity for 0.06 s; as :meth:`jog`, which raises the same.

        Args:
            arm: which.
            linear: velocity x, y, z [m/s].
            angular: angular velocity about x, y, z [rad/s].
            elbow: speed of the arm angle [rad/s].
            frame: from where they are seen: the robot's base, or the tool.
        """
        values = _as_sent([*linear, *angular, elbow])
        if not isinstance(values, tuple) or len(values) != JOINT_COUNT:
            raise CommandRefused(message("twist_malformed"))
        x, y, z, about_x, about_y, about_z, turn = values
        request = wire.JogTool(arm=arm, linear=(x, y, z), angular=(about_x, about_y, about_z), elbow=turn, frame=frame)
        self._ask(request, str)

    def _ask(self, request: Request, result: type[T]) -> T:
        return self._client.ask(request, result, self._on_step, timeout=None)


def shapes_of(
    surroundings: wire.Surroundings,
) -> tuple[dict[Side, GripperModules], dict[Side, tuple[Part, ...]], tuple[Obstacle, ...]]:
    """Grippers, tools and boxes as the collision model has them."""
    grippers = {side: GripperModules(surroundings.grippers.get(side.word, "servo")) for side in Side}
    tools = {
        side: tuple(
            Part(each.name, TOOL_FRAME, each.start, each.end, each.radius)
            for each in surroundings.tools.get(side.word, ())
        )
        for side in Side
    }
    return grippers, tools, tuple(Obstacle(each.name, each.pose, each.size) for each in surroundings.boxes)


def limits_of(surroundings: wire.Surroundings) -> JointLimits:
    """The joints' limits, no faster than the driver allows them to be."""
    known = surroundings.velocity
    return YUMI_LIMITS if known is None else replace(YUMI_LIMITS, velocity=known)


def _arms(arms: Arms) -> tuple[wire.Arm, ...]:
    return (arms,) if isinstance(arms, str) else tuple(arms)


def _as_sent(position: Position) -> wire.Position:
    """A position as it is sent. JSON has finite numbers only; all else is for the driver, which knows its joints."""
    if isinstance(position, str):
        return position
    try:
        pairs = position.items() if isinstance(position, Mapping) else enumerate(position, 1)
        values = {name: float(value) for name, value in pairs}
    except (TypeError, ValueError) as error:
        raise CommandRefused(message("goal_not_angles", given=quoted(position))) from error
    for name, value in values.items():
        if not isfinite(value):
            raise CommandRefused(message("goal_position_not_finite", position=name, value=str(value)))
    return {str(name): it for name, it in values.items()} if isinstance(position, Mapping) else tuple(values.values())
