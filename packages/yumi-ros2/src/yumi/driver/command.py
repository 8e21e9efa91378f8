"""A command to a driver: its arguments (arms, sides), result and caller, the lane it waits in, the robot it acts on.

The commands are in :mod:`yumi.driver.commands` and :mod:`yumi.driver.motion_commands`. A front end makes one of what it
was sent, and :func:`yumi.driver.commands.carry_out` runs it: the same checks and the same result for each front end.
"""

from __future__ import annotations

import logging
import os
import re
import time
from collections.abc import Callable, Hashable, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass, field
from enum import Enum, auto
from functools import partial
from threading import Lock
from typing import Annotated, ClassVar, Generic, Literal, Protocol, SupportsFloat, TypeVar, get_args

import msgspec

from abb_protocols.catalogue import Message, message
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import CommandRefused, ProtocolError, RobotNotReady
from abb_protocols.robot.gripper_values import GripperState
from abb_protocols.robot.joints import Joints, Pose, Side
from yumi.control.goals import CONFIGURED_DELAY
from yumi.control.hand_over import Commander, HandOver
from yumi.control.loop_commands import CommandPort, Commands
from yumi.control.shared_state import JointStates, Snapshots
from yumi.driver.gripper import GripperCheck, RwsGripper
from yumi.driver.gripper_follower import GripperFollower
from yumi.driver.reports import (
    ArmReport,
    ControllerStatus,
    DriverState,
    EventLog,
    GripperReport,
    MotionReport,
    Said,
    arm_report,
)
from yumi.driver.robot_manager import RobotManager
from yumi.driver.robot_state import Report
from yumi.driver.surroundings import Surroundings
from yumi.driver.teleoperation import Elsewhere, TeleoperatedArms, Teleoperation

_log = logging.getLogger(__name__)

R = TypeVar("R")
ArmName = Literal["right", "left"]
ArmNames = tuple[ArmName, ...]
SentPosition = tuple[float, ...] | dict[str, float] | str
"""Joint positions [rad]: all seven in chain order, some by name (the others stay), or the name of a pose."""

TimedPoint = tuple[float, Joints, Joints, Joints]
Scale = Annotated[float, msgspec.Meta(gt=0.0, le=1.0)]

EVERY_FRONT_END = frozenset({FrontEnd.SCRIPT, FrontEnd.SHELL, FrontEnd.ROS, FrontEnd.PAGE})


class Lane(Enum):
    """What a command waits for: ROS serves one command of a lane after the other, the endpoint limits changes alone."""

    READ = auto()
    """It changes nothing."""

    STOP = auto()
    """It is refused for nothing else that is asked for."""

    CHANGE = auto()
    """It takes its time, and its turn in the robot manager."""

    WRITE = auto()
    """Signals, variables and speeds, for which a routine of RAPID may wait."""

    CONTACT = auto()
    """Parts that may touch."""

    JOG = auto()
    """A moment of motion, again and again."""


class EndpointRequest(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field="method",
    tag=lambda name: re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower(),  # GetState: get_state
):
    """A line that a client sends over the local endpoint; ``id`` comes back with each answer."""

    id: int = 0

    @property
    def is_stop(self) -> bool:
        """Whether it stops the robot: then it is carried out whatever else was asked for."""
        return False


class Command(EndpointRequest, Generic[R], frozen=True):
    """What a driver can be asked to do; the fields are its arguments, which their types check, ``R`` is its result.

    The docstring is the help of its command on the command line. ROS offers it as a service of the robot manager: with
    the type of its name in ``yumi_interfaces``, or else as std_srvs/Trigger, for which each argument needs a default.

    Attributes:
        lane: what it waits for.
        front_ends: those that make an entry of their own from the table; a script does by ``driver.call(...)``.
        shell_name: its name on the command line, where that is another one.
        examples: for its help on the command line.
        service: its name in ROS, where that is another one.
        button: what its button on the page says; empty where the page asks for it by an element of its own.
    """

    lane: ClassVar[Lane] = Lane.CHANGE
    front_ends: ClassVar[frozenset[FrontEnd]] = EVERY_FRONT_END
    shell_name: ClassVar[str] = ""
    examples: ClassVar[tuple[str, ...]] = ()
    service: ClassVar[str] = ""
    button: ClassVar[str] = ""

    @classmethod
    def method(cls) -> str:
        """Its name in a request, as in ``{"method": "stop_egm"}``."""
        return str(cls.__struct_config__.tag)

    @classmethod
    def summary(cls) -> str:
        """What it does, in a sentence without its point."""
        return (cls.__doc__ or "").partition("\n")[0].replace("``", "").rstrip(".")

    @classmethod
    def result_type(cls) -> type[R]:
        """The type of its result."""
        (result,) = get_args(cls.__orig_bases__[0])  # type: ignore[attr-defined]
        return result  # type: ignore[no-any-return]

    @property
    def is_stop(self) -> bool:
        return self.lane is Lane.STOP

    def check(self) -> None:
        """See that the arguments go together; raises CommandRefused. A client calls it, too, before it sends."""

    def needed_arms(self, robot: CommandedRobot) -> Sequence[Side]:
        """The arms that a user must not have deactivated for it."""
        return ()

    def run(self, robot: CommandedRobot, caller: Caller) -> R:
        """Carry it out, on a thread of the caller.

        Raises:
            YumiError: it is refused, or has failed.
        """
        raise NotImplementedError


def sides_of(arms: Sequence[ArmName]) -> tuple[Side, ...]:
    """The arms, in our order."""
    return tuple(side for side in Side if side.word in arms)


def side_of(arm: ArmName) -> Side:
    """The arm."""
    return Side[arm.upper()]


@dataclass(frozen=True, eq=False)
class Caller:
    """Who has given a command.

    Attributes:
        client: its connection; an arm that one client jogs is not jogged by another one.
        front_end: what the client is; only a page's motions are those of a person.
        show: takes each step of the command.
        show_motions: takes how far motions are.
        is_gone: whether the client is not there any more, or the driver ends.
        hold: keeps what the client has begun under a name: it is ended when the client is gone, or after a time [s]
            unless it is held anew by then.
        elsewhere: has something done on a thread that may wait, while the command is answered.
    """

    client: Hashable = None
    front_end: FrontEnd | None = None
    show: Callable[[str], None] = lambda step: None
    show_motions: Callable[[dict[str, MotionReport]], None] = lambda motions: None
    is_gone: Callable[[], bool] = lambda: False
    hold: Callable[[Hashable, Callable[[], object], float | None], None] = lambda name, end, after: None
    elsewhere: Elsewhere = lambda work: work()

    @property
    def commander(self) -> Commander | None:
        """Whom its motions make the commander of an arm; None where their kind says."""
        return Commander.PAGE if self.front_end is FrontEnd.PAGE else None

    @property
    def name(self) -> str:
        """For people; empty for the program that owns the driver."""
        return "" if self.client is None else "page" if self.front_end is FrontEnd.PAGE else "another program"

    def check(self, step: str = "") -> None:
        """See that it is there; raises RobotNotReady: what it has asked for ends before its next step."""
        if self.is_gone():
            raise RobotNotReady(message("asker_is_gone"))

    def report(self, step: str) -> None:
        """Take a step that comes next; raises as :meth:`check`."""
        self.check(step)
        self.show(step)


class RunningMotion(Protocol):
    """A motion of an arm."""

    side: Side
    future: Future[None]

    @property
    def way(self) -> tuple[float, float | None]: ...


class Mover(TeleoperatedArms, Protocol):
    """Sends arms to positions, and has them follow streams."""

    def move(
        self,
        goals: Mapping[Side, SentPosition],
        speed_scale: float | None,
        acceleration: float | None,
        *,
        check: Callable[[], None] = lambda: None,
    ) -> Sequence[RunningMotion]: ...

    def move_tools(
        self,
        goals: Mapping[Side, SentPosition],
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

    def stop_own(self, sides: Sequence[Side]) -> Sequence[RunningMotion]: ...

    def stream(
        self,
        goals: Mapping[Side, SentPosition],
        velocities: Mapping[Side, Sequence[SupportsFloat]] | None = None,
        time: SupportsFloat | None = None,
        delay: float = CONFIGURED_DELAY,
        blend: SupportsFloat | None = None,
    ) -> bool: ...

    def end_stream(self, side: Side, owner: Hashable) -> None: ...

    def jog(self, side: Side, speeds: Sequence[float], owner: object, time: float | None = None) -> bool: ...

    def jog_tool(
        self,
        side: Side,
        twist: Sequence[float],
        tool: Pose,
        owner: object,
        time: float | None = None,
        *,
        is_in_tool: bool,
    ) -> bool: ...

    def check_jog_recent(self, values: Sequence[float], time: float | None) -> None: ...

    def end_jog(self, side: Side, owner: object) -> None: ...

    def is_moving(self, side: Side) -> bool: ...

    def fault(self, side: Side) -> Message | None: ...

    def commanding(self, side: Side) -> tuple[str, ...]: ...


class Control(CommandPort, Snapshots, Protocol):
    """What is needed of the control process."""

    hand_over: HandOver


@dataclass(frozen=True, eq=False)
class CommandedRobot:
    """A robot with its driver, as commands see and reach it.

    Attributes:
        address: ``host:port``.
        manager: the robot's state and modes.
        control: the control process.
        datagram: the newest datagram of an arm's robot.
        grippers: both.
        gripper_state: what is known of a gripper without asking the controller.
        force: of a grip where a command names none [N].
        mover: moves the arms.
        recover: recovers, with a report of each step, a check that raises where it is not wanted any more, and the stop
            that was confirmed; returns what was done.
        calibrate: calibrates grippers, with such a check.
        check_arms: refuses what needs an arm that a user has deactivated.
        on_change: called after each command that may have changed controllers or EGM.
        namespace: of its ROS nodes.
        surroundings: what must not collide.
        joints: an arm's joints as the controller was asked for them last, while EGM does not report them.
        on_subscription: called when a client wants to see the state again and again.
        events: the newest lines of the driver's log.
        moving: held while a motion of the arms is carried out, one at a time.
        followers: of the grippers' goals, where these come as a stream.
        teleoperation: of the arms and grippers.
    """

    address: str
    manager: RobotManager
    control: Control
    datagram: Callable[[Side], bytes]
    grippers: Mapping[Side, RwsGripper]
    gripper_state: Callable[[Side], GripperState | None]
    force: float
    mover: Mover
    recover: Callable[[Report, GripperCheck, str], str]
    calibrate: Callable[[Sequence[Side], GripperCheck], None]
    check_arms: Callable[[Sequence[Side]], None] = lambda sides: None
    on_change: Callable[[], None] = lambda: None
    namespace: str = ""
    surroundings: Surroundings = field(default_factory=Surroundings)
    joints: Callable[[Side], JointStates | None] = lambda side: None
    on_subscription: Callable[[], None] = lambda: None
    events: EventLog = field(default_factory=EventLog)
    moving: Lock = field(default_factory=Lock)
    followers: Mapping[Side, GripperFollower] = field(init=False)
    teleoperation: Teleoperation = field(init=False)
    _controllers: dict[Side, tuple[int, tuple[ControllerStatus, ...]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        grippers = {
            side: GripperFollower(gripper, self.force, self.manager.check_not_stopped)
            for side, gripper in self.grippers.items()
        }
        object.__setattr__(self, "followers", grippers)
        object.__setattr__(self, "teleoperation", Teleoperation(self.mover, self.control, grippers, self.on_change))

    def follow_with_grippers(self, closed: Mapping[Side, float], elsewhere: Elsewhere) -> None:
        """The next goals of a stream for grippers, from 0, open, to 1, closed; the newest counts, nothing waits.

        The gripper of an arm that another one has taken since the stream was granted gets none, which is reported.
        """

        def report(side: Side, reason: Message) -> None:
            _log.warning("%s", message("gripper_follows_not", arm=side.word, reason=reason))

        for side, goal in closed.items():
            try:
                with self.control.hand_over.switching((side,)):  # who takes the arm over afterwards forgets this goal
                    work = self.followers[side].follow(goal, partial(report, side))
            except CommandRefused as refusal:
                report(side, refusal.said)
                continue
            if work is not None:
                elsewhere(work)

    def state(self) -> DriverState:
        """All that is known of the driver, without its events."""
        robot = self.manager.state()
        return DriverState(
            time=time.time(),
            robot=self.address,
            process=os.getpid(),
            sessions=self.manager.session_count,
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
        for side in Side:
            activity = self.control.snapshot(side).activity
            if self._controllers.get(side, (-1, ()))[0] == activity:
                continue
            with suppress(RobotNotReady):  # the control process has ended: what was known last
                infos = self.control.call(Commands.list_controllers, side)
                reports = (ControllerStatus(it.name, it.kind, it.state.value, bool(it.claimed)) for it in infos)
                self._controllers[side] = activity, tuple(reports)
        return {side.word: self._controllers.get(side, (0, ()))[1] for side in Side}

    def _arm(self, side: Side, *, is_connected: bool) -> ArmReport:
        is_fault = self.mover.fault(side) is not None
        commanding = self.control.hand_over.of(side)
        report = arm_report(side, self.control.snapshot(side), self.datagram(side), commanding, is_fault=is_fault)
        read = self.joints(side) if report.position is None and is_connected else None
        return report if read is None else msgspec.structs.replace(report, resting=read.position)

    def _gripper(self, side: Side) -> GripperReport | None:
        try:
            state = self.gripper_state(side)
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
