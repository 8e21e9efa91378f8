"""The local endpoint's server: one thread that talks to all clients, and workers that carry out what they ask for.

Nothing here runs in the control process. The state is made from what the driver knows already: shared memory, the
monitor, subscribed signals. A client that reads too slowly, sends too much or breaks the protocol is disconnected.
"""

from __future__ import annotations

import asyncio
import logging
import os
import socket
import struct
import time
from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import FIRST_EXCEPTION, Future, ThreadPoolExecutor
from concurrent.futures import wait as wait_for_futures
from contextlib import ExitStack, suppress
from pathlib import Path
from threading import Event as Flag
from threading import Lock
from typing import Any, NamedTuple, Protocol

import msgspec

from yumi.catalogue import Message, cut, message, said_by
from yumi.control.loop_commands import CommandPort, Commands
from yumi.control.loop_events import ControllerReport, Event, is_fault
from yumi.control.shared_state import JointStates, Snapshot
from yumi.driver.endpoint import (
    FIRST_REQUEST,
    JOG_HOLDS,
    MAX_REQUEST,
    AllowCollision,
    Answer,
    AnyRequest,
    Arm,
    ArmReport,
    Attach,
    BoxReport,
    Calibrate,
    ControllerStatus,
    DriverState,
    EventReport,
    Failure,
    Follow,
    GetControllers,
    GetState,
    GetSurroundings,
    Grip,
    GripperReport,
    GripReport,
    Jog,
    JogTool,
    MotionReport,
    Move,
    Position,
    Recover,
    Request,
    Said,
    SetMode,
    SetSpeedScale,
    StartEgm,
    StopEgm,
    Subscribe,
    Surroundings,
    SwitchControllers,
    TimedPoint,
    ToolReport,
    arm_report,
    endpoint_path,
    failure_of,
    sides_of,
)
from yumi.driver.gripper import Check, Gripper
from yumi.driver.readiness import Mode, Report
from yumi.driver.robot_manager import RobotManager
from yumi.driver.settings import Settings
from yumi.errors import CommandRefused, GoalNotReached, ProtocolError, RobotNotReady, YumiError
from yumi.process.supervision import SupervisedThread
from yumi.robot.description import FINGERTIPS
from yumi.robot.gripper import TRAVEL, Direction, GripperState, go_to, grip
from yumi.robot.joints import Joints, Pose, Side

MAX_CLIENTS = 16
"""So many clients are served at once; one more is served when it asks for a stop."""

MAX_SILENT = 32
"""So many connections may have sent no request; then the oldest of them is closed."""

MAX_WORK = 8
"""So many requests that change something are carried out at once, or wait for their turn; then they are refused."""

MAX_PENDING = 8
"""So many requests of one client may wait for their answers."""

MAX_BACKLOG = 1 << 20
"""A client for which so much waits does not read, and is disconnected [bytes]."""

EVENTS = 100
"""So many lines of the driver's log are kept."""

_RECENT = 20  # events in a state that is asked for once
_FRESH = 0.010  # [s] a state that was made for one client serves another one for so long
_POLL_PERIOD = 0.1  # [s] between two polls of what is waited for
_CREDENTIALS = struct.Struct("3i")
_LEVELS = {logging.INFO: "info", logging.WARNING: "warning", logging.ERROR: "error"}


class RunningMotion(Protocol):
    """A motion of an arm."""

    side: Side
    future: Future[None]

    @property
    def way(self) -> tuple[float, float | None]: ...


class Mover(Protocol):
    """Sends arms to positions."""

    def move(
        self,
        goals: Mapping[Side, Position],
        speed_scale: float | None,
        acceleration: float | None,
        *,
        check: Callable[[], None] = lambda: None,
    ) -> Sequence[RunningMotion]: ...

    def move_tools(
        self,
        goals: Mapping[Side, Position],
        tools: Mapping[Side, Pose],
        speed_scale: float | None,
        acceleration: float | None,
        line_speed: float | None,
        *,
        is_linear: bool,
        check: Callable[[], None] = lambda: None,
    ) -> Sequence[RunningMotion]: ...

    def follow(
        self,
        trajectories: Mapping[Side, Sequence[TimedPoint]],
        start: Mapping[Side, Joints],
        check: Callable[[], None] = lambda: None,
    ) -> Sequence[RunningMotion]: ...

    def stop(self, sides: Sequence[Side]) -> Sequence[RunningMotion]: ...

    def jog(self, side: Side, speeds: Sequence[float], owner: object) -> bool: ...

    def jog_tool(self, side: Side, twist: Sequence[float], tool: Pose, owner: object, *, is_in_tool: bool) -> bool: ...

    def end_jog(self, side: Side, owner: object) -> None: ...

    def is_moving(self, side: Side) -> bool: ...

    def fault(self, side: Side) -> Message | None: ...

    def commanding(self, side: Side) -> tuple[str, ...]: ...


class Control(CommandPort, Protocol):
    """What is needed of the control process."""

    def snapshot(self, side: Side) -> Snapshot: ...


class DriverAccess(NamedTuple):
    """What a driver lets its clients see and ask for.

    Attributes:
        robot: its address, ``host:port``.
        manager: the robot's state and modes.
        control: the control process.
        datagram: the newest datagram of an arm's robot.
        grippers: both.
        gripper_state: what is known of a gripper without asking the controller.
        force: of a grip where a request names none [N].
        mover: moves the arms.
        recover: recovers, with a report of each step, a check that raises where it is not wanted any more, and the stop
            that was confirmed; returns what was done.
        calibrate: calibrates grippers, with such a check.
        check_arms: refuses what needs an arm that a user has deactivated.
        on_change: called after each request that may have changed controllers or EGM.
        namespace: of its ROS nodes.
        surroundings: what must not collide.
        joints: an arm's joints as the controller was asked for them last, while EGM does not report them.
        on_subscription: called when a client wants to see the state again and again.
    """

    robot: str
    manager: RobotManager
    control: Control
    datagram: Callable[[Side], bytes]
    grippers: Mapping[Side, Gripper]
    gripper_state: Callable[[Side], GripperState | None]
    force: float
    mover: Mover
    recover: Callable[[Report, Check, str], str]
    calibrate: Callable[[Sequence[Side], Check], None]
    check_arms: Callable[[Sequence[Side]], None] = lambda sides: None
    on_change: Callable[[], None] = lambda: None
    namespace: str = ""
    surroundings: Surroundings = Surroundings()
    joints: Callable[[Side], JointStates | None] = lambda side: None
    on_subscription: Callable[[], None] = lambda: None


def surroundings_of(settings: Settings) -> Surroundings:
    """What must not collide, as the settings declare it."""
    own = settings.collision
    return Surroundings(
        grippers={side.word: settings.gripper.modules(side).value for side in Side},
        tools={
            side.word: tuple(ToolReport(part.name, part.start, part.end, part.radius) for part in parts)
            for side, parts in own.tools().items()
        },
        boxes=tuple(BoxReport(each.name, each.centre, each.size) for each in own.obstacles()),
        is_limited=own.enabled,
        margin=own.margin,
    )


class Caller(NamedTuple):
    """Who has asked.

    Attributes:
        client: its connection; an arm that one client jogs is not jogged by another one.
        show: takes each step of the request.
        show_motions: takes how far motions are.
        is_gone: whether the client is not there any more, or the driver ends.
    """

    client: object
    show: Callable[[str], None]
    show_motions: Callable[[dict[str, MotionReport]], None]
    is_gone: Callable[[], bool]

    def check(self) -> None:
        """See that it is there; raises RobotNotReady: what it has asked for ends before its next step."""
        if self.is_gone():
            raise RobotNotReady(message("asker_is_gone"))

    def report(self, step: str) -> None:
        """Take a step that comes next; raises as :meth:`check`."""
        self.check()
        self.show(step)


class Handlers:
    """Carries out requests, on the threads of those who call it; each request has one method, see ``HANDLERS``."""

    def __init__(self, access: DriverAccess) -> None:
        self._access = access
        self._moving = Lock()  # one motion of the arms at a time
        self._controllers: dict[Side, tuple[int, tuple[ControllerStatus, ...]]] = {}
        self._events: deque[EventReport] = deque(maxlen=EVENTS)
        self._count = 0
        self._lock = Lock()

    def note(self, level: int, said: Message | str) -> None:
        """Keep a line of the driver's log, with a level of :mod:`logging`; none for debugging."""
        if level < logging.INFO:
            return
        with self._lock:
            self._count += 1
            word = _LEVELS.get(level, "info")
            self._events.append(EventReport(self._count, time.time(), word, Said.of(said)))

    def events_since(self, number: int) -> tuple[EventReport, ...]:
        """The lines after ``number`` that are still there."""
        with self._lock:
            return tuple(event for event in self._events if event.number > number)

    @property
    def event_count(self) -> int:
        """The number of the newest line."""
        return self._count

    def handle(self, request: Request, caller: Caller) -> object:
        """Carry out a request; returns what JSON can be made of.

        Raises:
            YumiError: it is refused, or has failed.
        """
        try:
            return HANDLERS[type(request)](self, request, caller)
        finally:
            if not isinstance(request, GetState | GetSurroundings | GetControllers | Jog | JogTool):
                self._access.on_change()

    # What only looks

    def state(self) -> DriverState:
        """All that is known of the driver, without its events."""
        access, robot = self._access, self._access.manager.state()
        return DriverState(
            time=time.time(),
            robot=access.robot,
            process=os.getpid(),
            is_connected=robot.is_connected,
            operating_mode=robot.operating_mode.value if robot.operating_mode else None,
            motors=robot.controller_state.value if robot.controller_state else None,
            program=robot.execution.value if robot.execution else None,
            machines={side.word: machine.name if machine else None for side, machine in robot.machines.items()},
            egm={side.word: egm for side, egm in robot.egm.items()},
            speed_scale=robot.speed_scale,
            speed_ratio=robot.speed_ratio,
            reasons=tuple(map(Said.of, robot.reasons)),
            causes=tuple(map(Said.of, robot.causes)),
            stop=robot.stop,
            arms={side.word: self._arm(side, is_connected=robot.is_connected) for side in Side},
            controllers=self.controllers(),
            grippers={side.word: self._gripper(side) for side in Side},
            allowed_collisions=robot.allowed_collisions,
        )

    def controllers(self) -> dict[str, tuple[ControllerStatus, ...]]:
        """Asked for again only when an arm's snapshot says that they have changed."""
        control = self._access.control
        for side in Side:
            activity = control.snapshot(side).activity
            if self._controllers.get(side, (-1, ()))[0] == activity:
                continue
            with suppress(RobotNotReady):  # the control process has ended: what was known last
                infos = control.call(Commands.list_controllers, side)
                reports = (ControllerStatus(it.name, it.kind, it.state.value, bool(it.claimed)) for it in infos)
                self._controllers[side] = activity, tuple(reports)
        return {side.word: self._controllers.get(side, (0, ()))[1] for side in Side}

    def _arm(self, side: Side, *, is_connected: bool) -> ArmReport:
        access = self._access
        is_fault = access.mover.fault(side) is not None
        report = arm_report(side, access.control.snapshot(side), access.datagram(side), is_fault=is_fault)
        read = access.joints(side) if report.position is None and is_connected else None
        return report if read is None else msgspec.structs.replace(report, resting=read.position)

    def _gripper(self, side: Side) -> GripperReport | None:
        try:
            state = self._access.gripper_state(side)
        except ProtocolError:
            return None
        if state is None:
            return None
        return GripperReport(
            state=state.state.name.lower().replace("_", " "),
            is_calibrated=state.is_calibrated,
            is_holding=state.is_holding,
            width=2.0 * state.position,
            force=state.force,
            error=state.error,
        )

    # What changes something

    def start_egm(self, request: StartEgm, caller: Caller) -> str:
        arms = sides_of(request.arms)
        self._access.check_arms(arms or tuple(Side))
        return self._access.manager.start_egm(arms or None, caller.report, caller.check)

    def set_mode(self, request: SetMode, caller: Caller) -> str:
        mode = Mode(request.mode)
        self._access.check_arms(mode.arms)
        if mode is Mode.MOTORS_OFF:  # a stop is carried out for who is gone, too
            return self._access.manager.go_to(mode, caller.show)
        return self._access.manager.go_to(mode, caller.report, caller.check)

    def recover(self, request: Recover, caller: Caller) -> str:
        self._access.check_arms(self._access.manager.egm_arms)
        return self._access.recover(caller.report, caller.check, request.confirm)

    def calibrate(self, request: Calibrate, caller: Caller) -> str:
        sides = sides_of(request.arms)
        if not sides:
            raise CommandRefused(message("no_gripper_named"))
        with ExitStack() as stack:
            for side in sides:
                stack.enter_context(self._access.grippers[side].alone())
            self._access.calibrate(sides, caller.check)
        words = " and ".join(side.word for side in sides)
        return f"The {words} gripper{'s are' if len(sides) > 1 else ' is'} calibrated"

    def grip(self, request: Grip, caller: Caller) -> GripReport:
        (side,) = sides_of((request.arm,))
        access, opens = self._access, request.action == "open"
        if opens and request.force is not None:
            raise CommandRefused(message("force_while_opening"))
        if not opens and request.width is not None:
            raise CommandRefused(message("width_while_closing"))
        if opens:
            goal = go_to(TRAVEL if request.width is None else request.width / 2.0)
        else:
            goal = grip(Direction.INWARDS, access.force if request.force is None else request.force)
        gripper = access.grippers[side]
        with gripper.alone():
            gripper.begin(goal, access.manager.check_not_stopped)
            outcome = gripper.wait(goal, is_cancelled=caller.is_gone)
        if outcome is None:
            raise GoalNotReached(message("gripper_stopped_asker_gone", arm=side.word))
        return GripReport(outcome, 2.0 * gripper.last_position)

    def switch(self, request: SwitchControllers, caller: Caller) -> str:
        (side,) = sides_of((request.arm,))
        if not request.activate and not request.deactivate:
            raise CommandRefused(message("no_controller_named"))
        self._access.check_arms((side,))
        done = self._access.control.call(Commands.switch_controllers, side, request.activate, request.deactivate)
        return done or f"The controllers of the {side.word} arm are switched"

    def move(self, request: Move, caller: Caller) -> str:
        access = self._access
        goals = {
            side: goal for side, goal in ((Side.RIGHT, request.right), (Side.LEFT, request.left)) if goal is not None
        }
        speed_scale, acceleration = request.speed_scale, request.acceleration
        if request.is_pose and request.speed is not None and not request.is_linear:
            raise CommandRefused(message("tool_speed_without_line"))
        if not request.is_pose and (request.is_linear or request.speed is not None):
            raise CommandRefused(message("line_without_pose"))

        def begin() -> Sequence[RunningMotion]:
            if not request.is_pose:
                return access.mover.move(goals, speed_scale, acceleration, check=caller.check)
            tools = {side: access.manager.tcp(side) for side in goals}
            return access.mover.move_tools(
                goals, tools, speed_scale, acceleration, request.speed, is_linear=request.is_linear, check=caller.check
            )

        return self._move(tuple(goals), begin, request.timeout, caller)

    def follow(self, request: Follow, caller: Caller) -> str:
        ways = {side: way for side, way in ((Side.RIGHT, request.right), (Side.LEFT, request.left)) if way is not None}
        start = {side: request.start[side.word] for side in Side if side.word in request.start}
        mover = self._access.mover
        return self._move(tuple(ways), lambda: mover.follow(ways, start, caller.check), None, caller)

    def _move(
        self, sides: Sequence[Side], begin: Callable[[], Sequence[RunningMotion]], timeout: float | None, caller: Caller
    ) -> str:
        """Move arms, wait until they stand, and give them back to the controllers that commanded them."""
        access = self._access
        if not sides:
            raise CommandRefused(message("no_arm_has_goal"))
        access.check_arms(sides)
        if not self._moving.acquire(blocking=False):
            raise CommandRefused(message("another_move_under_way"))
        try:
            before = {side: access.mover.commanding(side) for side in sides}
            for side, names in before.items():
                if access.mover.is_moving(side):
                    if not names:
                        raise CommandRefused(message("arm_moves_without_controller", arm=side.word))
                    raise CommandRefused(message("arm_moves_commanded_by", arm=side.word, controllers=tuple(names)))
            try:
                motions = begin()
            except YumiError:  # refused: nothing has moved
                self._give_back(before)
                raise
            self._wait(motions, timeout, caller)
            self._give_back(before)
        finally:
            self._moving.release()
        return (
            f"The {' and the '.join(side.word for side in sides)} arm stand{'' if len(sides) > 1 else 's'} at the goal"
        )

    def jog(self, request: Jog | JogTool, caller: Caller) -> str:
        """Move an arm for a moment; a move that is being carried out goes first."""
        (side,) = sides_of((request.arm,))
        self._access.check_arms((side,))
        if not self._moving.acquire(blocking=False):
            raise CommandRefused(message("another_move_under_way"))
        try:
            caller.check()
            if isinstance(request, Jog):
                is_switched = self._access.mover.jog(side, request.speeds, caller.client)
            else:
                twist, is_in_tool = (*request.linear, *request.angular, request.elbow), request.frame == "tool"
                is_switched = self._access.mover.jog_tool(side, twist, FINGERTIPS, caller.client, is_in_tool=is_in_tool)
            if is_switched:
                self._access.on_change()
        finally:
            self._moving.release()
        return ""

    def allow_collision(self, request: AllowCollision, caller: Caller) -> str:
        manager, part, other = self._access.manager, request.part, request.other
        if request.seconds == 0.0:
            return manager.end_allowed_collision(part, other)
        return manager.allow_collision(part, other, request.seconds)

    def end_allowed_collisions(self, pairs: Collection[tuple[str, str]]) -> None:
        """Keep apart what a client has let touch that is not there any more."""
        for part, other in pairs:
            with suppress(YumiError):  # the other pairs end all the same; without the control process none is allowed
                self._access.manager.end_allowed_collision(part, other)

    def end_jog(self, arm: Arm, client: object) -> None:
        """Stop an arm that a client has jogged and asks for no more."""
        for side in sides_of((arm,)):
            self._access.mover.end_jog(side, client)

    def _give_back(self, commanding: Mapping[Side, tuple[str, ...]]) -> None:
        """Have these controllers command the arms again; not after a motion that was stopped: the arm holds then."""
        access = self._access
        for side, names in commanding.items():
            now = access.mover.commanding(side)
            if names and names != now and access.control.snapshot(side).is_running:
                access.control.call(Commands.switch_controllers, side, names, now)

    def _wait(self, motions: Sequence[RunningMotion], timeout: float | None, caller: Caller) -> None:
        """Until all arms stand at their goals; else those that still move are stopped, and GoalNotReached is raised."""
        deadline = None if timeout is None else time.monotonic() + timeout
        futures = [motion.future for motion in motions]
        try:
            while not all(future.done() for future in futures):
                done, _ = wait_for_futures(futures, _POLL_PERIOD, FIRST_EXCEPTION)
                for future in done:
                    future.result()
                with suppress(YumiError):  # how far they are is only shown
                    caller.show_motions({it.side.word: MotionReport(*it.way) for it in motions})
                if caller.is_gone():
                    raise GoalNotReached(message("motion_stopped_asker_gone"))
                if deadline is not None and time.monotonic() > deadline:
                    raise GoalNotReached(message("motion_took_too_long", longest=timeout))
            for future in futures:
                future.result()
        except BaseException:
            with suppress(YumiError):  # what ended the motion is what a person must read
                self._access.mover.stop([motion.side for motion in motions if not motion.future.done()])
            raise


HANDLERS: Mapping[type[Request], Callable[[Handlers, Any, Caller], object]] = {
    GetState: lambda it, request, caller: msgspec.structs.replace(
        it.state(), events=it.events_since(it.event_count - _RECENT)
    ),
    GetSurroundings: lambda it, request, caller: it._access.surroundings,
    GetControllers: lambda it, request, caller: it.controllers(),
    StopEgm: lambda it, request, caller: it._access.manager.stop_egm(),
    SetSpeedScale: lambda it, request, caller: it._access.manager.speed.set(request.speed_scale),
    StartEgm: Handlers.start_egm,
    SetMode: Handlers.set_mode,
    Recover: Handlers.recover,
    Calibrate: Handlers.calibrate,
    Grip: Handlers.grip,
    Move: Handlers.move,
    Follow: Handlers.follow,
    Jog: Handlers.jog,
    JogTool: Handlers.jog,
    SwitchControllers: Handlers.switch,
    AllowCollision: Handlers.allow_collision,
}
"""What may be asked for; nothing else is called for a client."""

_AT_ONCE = (
    GetState,
    GetSurroundings,
    GetControllers,
    StopEgm,
    SetSpeedScale,
    Jog,
    JogTool,
    AllowCollision,
)  # these wait for nothing that others have asked for

_FULL = message("too_many_clients", most=MAX_CLIENTS)
_SILENT = message("silent_client", duration=FIRST_REQUEST)

_requests = msgspec.json.Decoder(AnyRequest)
_log = logging.getLogger(__name__)


class _Client:
    """One connection, on the server's event loop."""

    def __init__(self, writer: asyncio.StreamWriter, loop: asyncio.AbstractEventLoop) -> None:
        self.writer = writer
        self.is_gone = False
        self.is_served = False  # one of MAX_CLIENTS
        self.is_attached = False
        self.silence: asyncio.TimerHandle | None = None  # what disconnects it unless it asks for something
        self.pending = 0
        self.subscription: asyncio.Task[None] | None = None
        self.jogs: dict[Arm, asyncio.TimerHandle] = {}  # what ends them
        self.allowed: set[tuple[str, str]] = set()  # parts that may touch as long as it is there, or for less
        self._loop = loop

    def send(self, answer: Answer) -> None:
        """From the loop's thread."""
        if self.is_gone:
            return
        self.writer.write(msgspec.json.encode(answer) + b"\n")
        if self.writer.transport.get_write_buffer_size() > MAX_BACKLOG:
            self.is_gone = True
            self.writer.transport.abort()

    def end_silence(self) -> None:
        """It has asked for something, or is gone."""
        if self.silence is not None:
            self.silence.cancel()
            self.silence = None

    def send_soon(self, answer: Answer) -> None:
        """From any thread."""
        self.call_soon(self.send, answer)

    def call_soon(self, call: Callable[..., object], *args: Any) -> None:
        """Have the loop's thread call something; from any thread."""
        with suppress(RuntimeError):  # the loop has ended meanwhile
            self._loop.call_soon_threadsafe(call, *args)


class EndpointServer:
    """Serves the local endpoint of a driver, from :meth:`start` to :meth:`stop`.

    Args:
        access: what the driver lets its clients see and ask for.
        log: takes a level of :mod:`logging` and a sentence.

    Attributes:
        path: of its socket, while it serves.
    """

    def __init__(
        self, access: DriverAccess, log: Callable[[int, Message | str], None] = lambda level, said: None
    ) -> None:
        self.path = Path()
        self._names = access.robot, access.namespace
        self._handlers = Handlers(access)
        self._interrupt = access.manager.interrupt
        self._on_subscription = access.on_subscription
        self._log = log
        self._clients: dict[_Client, None] = {}  # all that are connected, the oldest first
        self._work = 0
        self._made = (0.0, msgspec.Raw())
        self._making = Lock()
        self._is_over = Flag()
        self._is_listening = Flag()
        self._end: Callable[[], None] = lambda: None
        self._thread = SupervisedThread("endpoint", self._run, self._is_over)
        self._workers = ThreadPoolExecutor(MAX_CLIENTS, "endpoint-work")
        self._stops = ThreadPoolExecutor(2, "endpoint-stop")  # a stop waits for no other request
        # The end of a jog waits neither for requests nor on the loop's thread, which all clients need.
        self._jog_ends = ThreadPoolExecutor(len(Side), "endpoint-end-jog")

    def note(self, level: int, said: Message | str) -> None:
        """Keep a line of the driver's log for the clients, with a level of :mod:`logging`; from any thread."""
        self._handlers.note(level, said)

    def note_event(self, event: Event) -> None:
        """Keep an event of the control process, unless it is a controller's own."""
        if not isinstance(event, ControllerReport):
            self._handlers.note(logging.WARNING if is_fault(event) else logging.INFO, event.said)

    @property
    def client_count(self) -> int:
        """How many clients are served."""
        return sum(client.is_served for client in self._clients)

    def start(self) -> None:
        """Serve from now on; the socket is there when this returns. A driver without a place for it goes on without."""
        try:
            self.path = endpoint_path(*self._names)
        except RobotNotReady as error:
            self._log(logging.WARNING, f"No command and no second script finds this driver: {error}")
            return
        self._thread.start()
        if not self._is_listening.wait(5.0):
            self._log(
                logging.ERROR, f"The local endpoint {self.path} does not listen; the commands do not find the driver."
            )

    def stop(self) -> None:
        """Disconnect all clients, end what they have asked for at its next step, and remove the socket."""
        self._is_over.set()
        self._interrupt()
        self._end()
        self._thread.join()
        self._workers.shutdown()
        self._stops.shutdown()
        self._jog_ends.shutdown()

    def _run(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        loop, is_over = asyncio.get_running_loop(), asyncio.Event()

        def end() -> None:
            with suppress(RuntimeError):  # the loop has ended
                loop.call_soon_threadsafe(is_over.set)

        server = await asyncio.start_unix_server(self._connect, self.path, limit=MAX_REQUEST)
        try:
            self.path.chmod(0o600)
            self._end = end
            self._is_listening.set()
            if not self._is_over.is_set():
                await is_over.wait()
        finally:
            self.path.unlink(missing_ok=True)
            # The server last: asyncio would leave a connection open that it has accepted and not handed over yet.
            while others := asyncio.all_tasks() - {asyncio.current_task()}:
                for client in tuple(self._clients):
                    client.is_gone = True
                    client.writer.transport.abort()
                await asyncio.wait(others, timeout=_POLL_PERIOD)
            server.close()

    async def _connect(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        client = _Client(writer, asyncio.get_running_loop())
        peer: socket.socket = writer.get_extra_info("socket")
        _, user, _ = _CREDENTIALS.unpack(peer.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size))
        try:
            if user != os.getuid() or self._is_over.is_set():
                writer.transport.abort()
            else:
                self._clients[client] = None
                self._expect_request(client)
                await self._read(reader, client)
        except ConnectionError:
            return  # the client has gone
        finally:
            client.is_gone = True
            client.end_silence()
            self._clients.pop(client, None)
            if client.subscription is not None:
                client.subscription.cancel()
            for timer in client.jogs.values():
                timer.cancel()
            ends = [self._end_jog(client, arm) for arm in client.jogs]
            if client.allowed:
                ends.append(self._end_allowed(client))
            writer.close()
            with suppress(ConnectionError):
                await writer.wait_closed()
            await asyncio.gather(*ends)

    def _expect_request(self, client: _Client) -> None:
        """Disconnect a client that is not served unless it asks for something."""
        client.silence = asyncio.get_running_loop().call_later(FIRST_REQUEST, self._end_silent, client)
        silent = [each for each in self._clients if each.silence is not None]
        if len(silent) > MAX_SILENT:
            self._end_silent(silent[0])

    def _end_silent(self, client: _Client) -> None:
        """Disconnect a client that has asked for nothing, or has only attached while others had all places."""
        client.end_silence()
        client.send(_refused(0, _FULL if client.is_attached else _SILENT))
        client.is_gone = True
        client.writer.close()

    def _serves(self, client: _Client) -> bool:
        """Whether a client that has sent a request is one of those that are served."""
        client.is_served = client.is_served or self.client_count < MAX_CLIENTS
        if client.is_served:
            client.end_silence()
        return client.is_served

    async def _read(self, reader: asyncio.StreamReader, client: _Client) -> None:
        while True:
            try:
                line = await reader.readline()
            except ValueError:
                client.send(_refused(0, message("request_too_long", most=MAX_REQUEST)))
                return
            if not line.endswith(b"\n") or not await self._take(line, client):
                return

    async def _take(self, line: bytes, client: _Client) -> bool:
        """Serve what a client asks for in a line; whether the client may ask for more."""
        try:
            request = _requests.decode(line)
        except (ValueError, RecursionError) as error:  # also of a document that is no request, or not in UTF-8
            client.send(_not_understood(line, error))
            return True
        if client.is_gone and not _is_stop(request):
            return False  # it came while the connection was being closed
        if not self._serves(client):
            return await self._serve_beyond_limit(client, request)
        if isinstance(request, Subscribe):
            if client.subscription is not None:
                client.subscription.cancel()
            client.subscription = asyncio.create_task(self._publish(client, request))
        elif not isinstance(request, Attach):
            self._begin_unless_full(client, request)
        return True

    async def _serve_beyond_limit(self, client: _Client, request: AnyRequest) -> bool:
        """Serve a stop of a client that is none of those served; whether the client may ask for another one."""
        if isinstance(request, Attach):
            client.is_attached = True
        elif _is_stop(request):
            client.end_silence()
            await self._begin(client, request)
            self._expect_request(client)
        else:
            client.send(_refused(request.id, _FULL))
            return False
        return True

    def _begin_unless_full(self, client: _Client, request: Request) -> None:
        is_stop = _is_stop(request)  # never refused
        is_work = not is_stop and not isinstance(request, _AT_ONCE)
        if (client.pending >= MAX_PENDING and not is_stop) or (is_work and self._work >= MAX_WORK):
            client.send(_refused(request.id, message("too_many_requests")))
        else:
            self._begin(client, request, is_work=is_work)

    def _begin(self, client: _Client, request: Request, *, is_work: bool = False) -> asyncio.Future[None]:
        client.pending += 1
        self._work += is_work

        def end(_: object) -> None:
            client.pending -= 1
            self._work -= is_work

        workers = self._stops if _is_stop(request) else self._workers
        work = asyncio.get_running_loop().run_in_executor(workers, self._answer, client, request)
        work.add_done_callback(end)
        return work

    def _answer(self, client: _Client, request: Request) -> None:
        """On a worker's thread."""
        caller = Caller(
            client,
            lambda step: client.send_soon(Answer(id=request.id, step=step)),
            lambda motions: client.send_soon(Answer(id=request.id, motions=motions)),
            lambda: client.is_gone or self._is_over.is_set(),
        )
        is_refused = False
        try:
            result = msgspec.Raw(msgspec.json.encode(self._handlers.handle(request, caller)))
            answer = Answer(id=request.id, result=result)
        except Exception as error:  # a fault of ours, too: the client must not wait for ever
            answer, is_refused = _failed(request, error), isinstance(error, CommandRefused)
        if isinstance(request, Jog | JogTool):
            client.call_soon(self._hold_jog, client, request.arm)
        # What was refused is not the client's own to end; what has failed otherwise may have been served all the same.
        if isinstance(request, AllowCollision) and request.seconds and not is_refused:
            client.call_soon(self._note_allowed, client, request)
        client.send_soon(answer)

    def _hold_jog(self, client: _Client, arm: Arm) -> None:
        """A client has jogged an arm: stop it unless the client goes on, whatever timeouts the controllers have."""
        if arm in client.jogs:
            client.jogs.pop(arm).cancel()
        if client.is_gone:
            self._end_jog(client, arm)
        else:
            client.jogs[arm] = asyncio.get_running_loop().call_later(JOG_HOLDS, self._end_jog, client, arm)

    def _note_allowed(self, client: _Client, request: AllowCollision) -> None:
        """The parts may touch no longer than the client is there; it may have gone meanwhile."""
        client.allowed.add((request.part, request.other))
        if client.is_gone:
            self._end_allowed(client)

    def _end_allowed(self, client: _Client) -> asyncio.Future[None]:
        """Keep apart what a client has let touch."""
        pairs, client.allowed = client.allowed, set()
        handlers = self._handlers
        return asyncio.get_running_loop().run_in_executor(self._jog_ends, handlers.end_allowed_collisions, pairs)

    def _end_jog(self, client: _Client, arm: Arm) -> asyncio.Future[None]:
        return asyncio.get_running_loop().run_in_executor(self._jog_ends, self._handlers.end_jog, arm, client)

    async def _publish(self, client: _Client, request: Subscribe) -> None:
        self._on_subscription()
        loop, known = asyncio.get_running_loop(), max(0, self._handlers.event_count - _RECENT)
        due = loop.time()
        while not client.is_gone:
            try:
                state = await loop.run_in_executor(self._workers, self._state)
            except Exception as error:  # as of other requests; the subscription has ended
                client.send(_failed(request, error))
                return
            events = self._handlers.events_since(known)
            known = events[-1].number if events else known
            client.send(Answer(id=request.id, state=state, events=events))
            due = max(due + 1.0 / request.rate, loop.time())
            await asyncio.sleep(due - loop.time())

    def _state(self) -> msgspec.Raw:
        """The state as JSON, made once for all who want it at the same time."""
        with self._making:
            now = time.monotonic()
            if now - self._made[0] > _FRESH:
                self._made = now, msgspec.Raw(msgspec.json.encode(self._handlers.state()))
            return self._made[1]


def _is_stop(request: Request) -> bool:
    return isinstance(request, StopEgm) or (isinstance(request, SetMode) and request.mode == "motors_off")


def _refused(number: int, said: Message) -> Answer:
    return Answer(id=number, error=Failure("CommandRefused", Said.of(said)))


def _failed(request: Request, error: Exception) -> Answer:
    """Why a request failed; what is no refusal is a fault of the driver, which its log shows whole."""
    if isinstance(error, YumiError):
        return Answer(id=request.id, error=failure_of(error))
    _log.error("A request of the local endpoint failed: %s", request, exc_info=error)
    return _refused(request.id, message("driver_failed", kind=type(error).__name__, why=said_by(error)))


def _not_understood(line: bytes, error: Exception) -> Answer:
    """Of what is no request, with the number that it has, so that its client knows which one it was."""
    try:
        number = msgspec.json.decode(line)["id"]
    except (ValueError, RecursionError, KeyError, TypeError):
        number = 0
    if isinstance(error, RecursionError):
        why = message("request_nested_too_deeply")
    elif isinstance(error, UnicodeDecodeError):
        why = message("request_not_utf_8")
    else:
        why = message("text", text=cut(str(error)))
    return _refused(number if isinstance(number, int) else 0, message("request_not_understood", why=why))
