"""The local endpoint of a running driver: what is said over it, where its socket is, and the client's end of it.

A driver listens on a Unix socket that only its own user may open. A client writes one JSON document a line: a request
with an ``id`` of its choice and a ``method``. It gets documents of the same ``id`` back: ``step`` and ``motions`` while
the request is carried out, then ``result`` or ``error``. After ``subscribe`` it gets the state at the rate it asked
for, with the events since the last one. A connection without a request is closed after :data:`FIRST_REQUEST`.
Everything is in SI units; joints are in chain order.
"""

from __future__ import annotations

import os
import re
import socket
import stat
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from enum import Enum
from html import escape
from math import degrees, isfinite
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import msgspec

from yumi import errors
from yumi.catalogue import FrontEnd, Message, from_wire, in_words, is_known, message, said_by, sentence, to_wire
from yumi.control.motion.robot_response import STANDING
from yumi.control.shared_state import PROBLEMS, Limited, Problem, Snapshot
from yumi.driver.readiness import robot_lines
from yumi.egm.codec import SensorCodec
from yumi.errors import ProtocolError, RobotNotReady, YumiError
from yumi.process.single_instance import lock_folder
from yumi.robot.gripper import Outcome
from yumi.robot.joints import Joints, Pose, Side, Vector, abb_from_chain
from yumi.robot.kinematics import tool0_to_body

MAX_REQUEST = 1 << 20
"""A request is no longer than this [bytes]: a plan of some minutes."""

FIRST_REQUEST = 5.0
"""A client sends its first request within this time [s], ``attach`` where it wants nothing yet, or is disconnected."""

JOG_HOLDS = 0.06
"""A jog moves an arm for so long, unless the next one comes [s]: braking from the page's highest speed takes 0.12 s."""

ANSWER = 10.0
"""What needs no motion is answered within this time [s]."""

Arm = Literal["right", "left"]
ModeName = Literal["motors_off", "ready", "egm_left", "egm_right", "egm_both"]
Position = tuple[float, ...] | dict[str, float] | str
"""Joint positions [rad]: all seven in chain order, some by name (the others stay), or the name of a pose."""

TimedPoint = tuple[float, Joints, Joints, Joints]
Scale = Annotated[float, msgspec.Meta(gt=0.0, le=1.0)]


# ---- requests


class Request(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field="method",
    tag=lambda name: re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower(),  # GetState: get_state
):
    """What a client asks for; ``id`` comes back with each answer."""

    id: int = 0


class Attach(Request, frozen=True):
    """Keep the connection although nothing is asked for yet; the only request without an answer."""


class GetState(Request, frozen=True):
    """All that is known: a :class:`DriverState`."""


class Subscribe(Request, frozen=True):
    """The same again and again, ``rate`` times a second."""

    rate: Annotated[float, msgspec.Meta(ge=0.1, le=60.0)] = 30.0


class GetSurroundings(Request, frozen=True):
    """The shapes that must not collide, as the driver's settings declare them: :class:`Surroundings`."""


class GetControllers(Request, frozen=True):
    """The controllers of each arm: :class:`ControllerStatus`."""


class StartEgm(Request, frozen=True):
    """Start EGM on ``arms``, or on those that are configured; makes the robot ready first if need be."""

    arms: tuple[Arm, ...] = ()


class StopEgm(Request, frozen=True):
    """Bring the arms to rest and end EGM; waits for nothing else."""


class SetMode(Request, frozen=True):
    """Bring the robot to a mode."""

    mode: ModeName


class Recover(Request, frozen=True):
    """Bring the robot back after a stop; ``confirm`` is the id of the stop that a person has confirmed."""

    confirm: str = ""


class Calibrate(Request, frozen=True):
    """Close the fingers of the grippers of ``arms`` and call that zero."""

    arms: tuple[Arm, ...] = ("right", "left")


class Grip(Request, frozen=True):
    """Open a gripper to ``width`` [m], or as far as it goes; or close it, and hold what is there with ``force`` [N]."""

    arm: Arm
    action: Literal["open", "close"]
    width: float | None = None
    force: float | None = None


class Move(Request, frozen=True):
    """Move arms to positions; the answer comes when they stand there.

    A client that goes away meanwhile stops them, as does ``timeout`` [s]. ``speed_scale`` is a factor on the joints'
    highest speeds, on top of the driver's.

    With ``is_pose`` a position is a pose of the tool in use in the robot's body: x, y, z [m] and, where the orientation
    does not stay, the quaternion w, x, y, z. With ``is_linear``, too, the tool moves there on a straight line, at most
    with ``speed`` [m/s].
    """

    right: Position | None = None
    left: Position | None = None
    speed_scale: Scale | None = None
    acceleration: Scale | None = None
    timeout: Annotated[float, msgspec.Meta(gt=0.0)] | None = None
    is_pose: bool = False
    is_linear: bool = False
    speed: Annotated[float, msgspec.Meta(gt=0.0)] | None = None


class Follow(Request, frozen=True):
    """Follow trajectories that were planned, beginning at the same moment; ended as :class:`Move`.

    ``start`` is where both arms have to be [rad]. Points are a time [s], and the positions [rad], velocities [rad/s]
    and accelerations [rad/s²] then, each (7,) in chain order.
    """

    start: dict[Arm, Joints]
    right: tuple[TimedPoint, ...] | None = None
    left: tuple[TimedPoint, ...] | None = None


class Jog(Request, frozen=True):
    """Move an arm with joint speeds [rad/s], (7,) in chain order, for 0.06 s.

    It is asked for again and again while the arm moves, such as 50 times a second. The first one only takes the arm
    over from standstill; the next one moves it. The driver stops the arm when its client goes away, or asks no more,
    whatever timeouts its controllers have. An arm that one client jogs is not jogged by another one.
    """

    arm: Arm
    speeds: Joints


class JogTool(Request, frozen=True):
    """Move the fingertips of an arm with a velocity for 0.06 s, as :class:`Jog` moves the joints.

    ``linear`` [m/s] and ``angular`` [rad/s] are seen from the robot's base or from the tool; ``elbow`` [rad/s] turns
    the arm angle.
    """

    arm: Arm
    linear: tuple[float, float, float] = (0.0, 0.0, 0.0)
    angular: tuple[float, float, float] = (0.0, 0.0, 0.0)
    elbow: float = 0.0
    frame: Literal["base", "tool"] = "base"


class SwitchControllers(Request, frozen=True):
    """Activate and deactivate controllers of one arm in one step."""

    arm: Arm
    activate: tuple[str, ...] = ()
    deactivate: tuple[str, ...] = ()


class SetSpeedScale(Request, frozen=True):
    """Set the factor on the speed of every controller."""

    speed_scale: float


class AllowCollision(Request, frozen=True):
    """Let two parts touch for ``seconds``, slowly; 0 ends it, as does the end of the client's connection."""

    part: str
    other: str
    seconds: float


AnyRequest = (
    Attach
    | GetState
    | Subscribe
    | GetSurroundings
    | GetControllers
    | StartEgm
    | StopEgm
    | SetMode
    | Recover
    | Calibrate
    | Grip
    | Move
    | Follow
    | Jog
    | JogTool
    | SwitchControllers
    | SetSpeedScale
    | AllowCollision
)
"""All that a driver may be asked for; anything else is refused."""


# ---- answers


class ArmMode(Enum):
    """What an arm does."""

    NO_EGM = "no_egm"
    """The robot sends no datagrams for it: EGM does not run."""

    IDLE = "idle"
    """The robot sends where it is, but does not follow: motors off, or RAPID stopped."""

    HOLDING = "holding"
    """It follows, and stands."""

    MOVING = "moving"
    """It follows, and moves."""

    FAULT = "fault"
    """Something stopped it; recovering brings it back."""


class CycleCounts(msgspec.Struct, frozen=True, kw_only=True):
    """The datagrams of an arm.

    Attributes:
        answered: by a reply of their own.
        missed: that got none.
        lost: that never arrived.
        late: that waited together with a newer one.
        refused: commands that were no finite numbers.
        position_limited: commands cut at a joint's range.
        slowed: commands that would have exceeded a speed, acceleration or jerk.
        interruptions: how often feedback stayed away for more than five cycles.
        period: mean time between two datagrams that the robot sent [s].
        jitter: mean difference of two datagrams' delays [s].
        worst_jitter: the largest one [s].
    """

    answered: int
    missed: int
    lost: int
    late: int
    refused: int
    position_limited: int
    slowed: int
    interruptions: int
    period: float
    jitter: float
    worst_jitter: float


class EgmReport(msgspec.Struct, frozen=True, kw_only=True):
    """What the robot says in its newest datagram beside where the arm is.

    Attributes:
        time: the controller's clock when the joints were measured, of unknown epoch [s].
        planned_time: when the robot will be where it plans to be, same clock [s]; None when it does not say.
        motors: of the robot: on, off or undefined.
        motion: state of its motion correction interface: running, stopped, error or undefined.
        rapid: its program: running, stopped or undefined.
        is_converged: whether it is within its convergence band.
        utilization: share of its performance in use, 1.0 is full; None when it does not say.
        torque: torque references of the motors in ABB's order and unit; None when it does not say.
        force: measured forces [N] and torques [Nm], (6,); None without a force sensor.
        is_collision: whether its supervision sees a collision; None before RobotWare 7.6.
    """

    time: float
    planned_time: float | None
    motors: str
    motion: str
    rapid: str
    is_converged: bool
    utilization: float | None = None
    torque: tuple[float, ...] | None = None
    force: tuple[float, ...] | None = None
    is_collision: bool | None = None


class ArmReport(msgspec.Struct, frozen=True, kw_only=True):
    """One arm now. What is measured is None while the robot sends no datagrams for it.

    Attributes:
        mode: what it does.
        time: when it was measured, UNIX time [s].
        session: EGM session, from 1; 0 before the first.
        position: measured [rad], (7,) in chain order.
        resting: the same as the controller was asked for it, some times a second while a client subscribes and EGM
            does not report it; None else.
        velocity: measured [rad/s], (7,).
        planned: where the robot plans to be [rad], (7,).
        sent: the position sent to it last [rad], (7,).
        goal: where the active controller is going [rad], (7,); None when none commands the arm.
        pose: of tool0 in the frame of the body [m], quaternion w first.
        egm: what else the robot reports.
        problem: why it holds whatever it is commanded to do; None when nothing is wrong.
        limited: what it is kept apart from now, or was 0.2 s ago; None while its commands lead it near to nothing.
        cycles: its datagrams.
    """

    mode: ArmMode
    time: float | None = None
    session: int = 0
    position: Joints | None = None
    resting: Joints | None = None
    velocity: Joints | None = None
    planned: Joints | None = None
    sent: Joints | None = None
    goal: Joints | None = None
    pose: Pose | None = None
    egm: EgmReport | None = None
    problem: Said | None = None
    limited: Limited | None = None
    cycles: CycleCounts | None = None


class ControllerStatus(msgspec.Struct, frozen=True):
    """A controller of an arm: its name, ros2_control's type, its lifecycle state, and whether it commands the arm."""

    name: str
    type: str
    state: str
    commands: bool


class GripperReport(msgspec.Struct, frozen=True, kw_only=True):
    """A gripper as its own signals show it.

    Attributes:
        state: what it is doing, in the gripper's words.
        is_calibrated: whether its position means anything.
        is_holding: whether its fingers press on something.
        width: between the fingers [m].
        force: what it holds an object with [N].
        error: its own error number; 0 is none.
    """

    state: str
    is_calibrated: bool
    is_holding: bool
    width: float
    force: float
    error: int


class Said(msgspec.Struct, frozen=True):
    """A message for a client: by its code a program decides, and by code and values a client of this version words it.

    Attributes:
        code: of the catalogue, see the page of all messages.
        sentence: what it says, in ROS's words, for clients that have no catalogue.
        values: of its text; SI units.
        actions: what a person can do about it.
    """

    code: str
    sentence: str
    values: dict[str, Any] = {}
    actions: tuple[str, ...] = ()

    @classmethod
    def of(cls, said: Message | str) -> Said:
        """A message, or a line of a log that is none."""
        if isinstance(said, str):
            return cls("text", said, {"text": said})
        actions = tuple(action.value for action in said.actions)
        return cls(said.code, sentence(said, FrontEnd.ROS), to_wire(said)["values"], actions)

    @property
    def message(self) -> Message:
        """The message, as far as this version knows it."""
        said = from_wire({"code": self.code, "values": self.values})
        assert isinstance(said, Message)
        return said if is_known(said) else message("text", text=self.sentence)


class EventReport(msgspec.Struct, frozen=True):
    """A line of the driver's log: its number from 1, UNIX time [s], level (info, warning, error) and what it says."""

    number: int
    time: float
    level: str
    said: Said


class DriverState(msgspec.Struct, frozen=True, kw_only=True):
    """A driver with its robot, now. What is unknown is None.

    Attributes:
        time: UNIX time [s].
        robot: its address.
        process: number of the driver's process.
        is_connected: whether the controller answers.
        operating_mode: the mode switch: AUTO, MANR or MANF.
        motors: of the controller: motoron, motoroff, or the stop that keeps them off.
        program: whether RAPID runs.
        machines: the state machine of each arm.
        egm: off, streaming or running, of each arm.
        speed_scale: factor in force on the speed of every controller.
        speed_ratio: override of the speeds of RAPID motions [%].
        reasons: why EGM can neither be started nor runs, what to do first being the first; empty when it can or does.
        causes: what stopped the robot, oldest first, while it is stopped; empty while it works.
        stop: id of the stop that a person must confirm before anything moves; empty where there is none.
        arms: both.
        controllers: of each arm.
        grippers: both; None while one is unknown.
        events: the newest lines of the driver's log.
        allowed_collisions: pairs of parts that may touch now.
    """

    time: float
    robot: str
    process: int
    is_connected: bool
    operating_mode: str | None
    motors: str | None
    program: str | None
    machines: dict[str, str | None]
    egm: dict[str, str]
    speed_scale: float
    speed_ratio: int | None
    reasons: tuple[Said, ...]
    causes: tuple[Said, ...]
    stop: str
    arms: dict[str, ArmReport]
    controllers: dict[str, tuple[ControllerStatus, ...]]
    grippers: dict[str, GripperReport | None]
    events: tuple[EventReport, ...] = ()
    allowed_collisions: tuple[str, ...] = ()

    @property
    def reason(self) -> str:
        """The reasons with what to do, in this program's words."""
        return in_words(each.message for each in self.reasons)

    @property
    def cause(self) -> str:
        """The causes with what to do, in this program's words."""
        return in_words(each.message for each in self.causes)

    def __repr__(self) -> str:
        """In lines, as ``yumi state`` prints it."""
        lines = [f"robot {self.robot}, driver process {self.process}"]
        lines += robot_lines(
            is_connected=self.is_connected,
            operating_mode=self.operating_mode,
            motors=self.motors,
            program=self.program,
            speed_scale=self.speed_scale,
            speed_ratio=self.speed_ratio,
            allowed_collisions=self.allowed_collisions,
            reasons=[each.message for each in self.reasons],
            causes=[each.message for each in self.causes],
        )
        for word, arm in self.arms.items():
            lines += self._arm_lines(word, arm)
        for word, gripper in self.grippers.items():
            if gripper is None:
                lines.append(f"{word} gripper: unknown")
                continue
            parts = [gripper.state, f"{gripper.width * 1e3:.1f} mm"]
            parts += ["holding"] if gripper.is_holding else []
            parts += [] if gripper.is_calibrated else ["not calibrated"]
            parts += [f"error {gripper.error}"] if gripper.error else []
            lines.append(f"{word} gripper: {', '.join(parts)}")
        return "\n".join([*lines, *(f"{event.level}: {event.said.message}" for event in self.events[-5:])])

    def _arm_lines(self, word: str, arm: ArmReport) -> list[str]:
        commanding = [each.name for each in self.controllers[word] if each.commands]
        parts = [f"EGM {self.egm[word]}"]
        parts += [arm.mode.value] if arm.mode is not ArmMode.NO_EGM else []
        parts += [f"commanded by {', '.join(commanding)}"] if commanding else []
        if arm.egm is not None and arm.egm.utilization is not None:
            parts.append(f"utilization {arm.egm.utilization:.0%}")
        if arm.cycles is not None and arm.cycles.answered:
            parts.append(f"{arm.cycles.answered} cycles, {arm.cycles.missed} missed")
        lines = [f"{word} arm: {', '.join(parts)}"]
        if arm.problem is not None:
            lines.append(f"  {arm.problem.message}")
        if arm.limited is not None:
            lines.append(f"  motion limited by {arm.limited}")
        if arm.position is not None:
            axes, axis_7 = abb_from_chain(arm.position)
            angles = "  ".join(f"j{axis} {degrees(angle):7.2f}" for axis, angle in enumerate((*axes, axis_7), 1))
            lines.append(f"  {angles}  [°]")
        return lines

    def _repr_html_(self) -> str:
        """For a notebook."""
        return f"<pre>{escape(repr(self))}</pre>"


class BoxReport(msgspec.Struct, frozen=True):
    """A box that stands around the robot: its name, the pose of its middle in the body's frame, its edges [m]."""

    name: str
    pose: Pose
    size: Vector


class ToolReport(msgspec.Struct, frozen=True):
    """A capsule that an arm carries beside its gripper: its name, both ends of its axis in tool0 and its radius [m]."""

    name: str
    start: Vector
    end: Vector
    radius: float


class Surroundings(msgspec.Struct, frozen=True, kw_only=True):
    """What a motion is planned with: what must not collide, as the driver's settings declare it, and its joint speeds.

    Attributes:
        grippers: the modules of each arm's gripper, in the words of the settings; an arm without an entry has a servo.
        tools: what each arm carries beside its gripper.
        boxes: what stands around the robot.
        is_limited: whether the driver keeps the arms apart from each other, the body and the boxes.
        margin: the distance it keeps [m].
        velocity: highest joint speeds that EGM allows [rad/s], (7,) in chain order; None where they are unknown.
    """

    grippers: dict[str, str] = {}
    tools: dict[str, tuple[ToolReport, ...]] = {}
    boxes: tuple[BoxReport, ...] = ()
    is_limited: bool = False
    margin: float = 0.0
    velocity: Joints | None = None


class GripReport(msgspec.Struct, frozen=True):
    """How a grip ended, and the distance between the fingers then [m]."""

    outcome: Outcome
    width: float


class MotionReport(msgspec.Struct, frozen=True):
    """How far a motion is: from 0 to 1, and the time it still takes [s], as far as that is known."""

    progress: float
    remaining: float | None


class Failure(msgspec.Struct, frozen=True):
    """Why a request was refused or failed: the class in :mod:`yumi.errors`, what it says, and the stop to confirm."""

    kind: str
    said: Said
    stop: str = ""


class Answer(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One line of a driver."""

    id: int = 0
    result: msgspec.Raw = msgspec.Raw()
    error: Failure | None = None
    step: str = ""
    motions: dict[str, MotionReport] = {}
    state: msgspec.Raw = msgspec.Raw()
    events: tuple[EventReport, ...] = ()


def arm_report(side: Side, snapshot: Snapshot, datagram: bytes = b"", *, is_fault: bool = False) -> ArmReport:
    """An arm as its control loop's ``snapshot`` and its robot's newest ``datagram`` show it."""
    it = snapshot
    counts = CycleCounts(
        answered=it.cycles,
        missed=it.wire.missed,
        lost=it.wire.lost,
        late=it.wire.late,
        refused=it.limiter.refused,
        position_limited=it.limiter.position_limited,
        slowed=it.limiter.slowed,
        interruptions=it.interruptions,
        period=it.wire.cycle_time,
        jitter=it.wire.jitter,
        worst_jitter=it.wire.worst_jitter,
    )
    if not it.is_streaming:
        mode = ArmMode.FAULT if is_fault else ArmMode.NO_EGM
        return ArmReport(mode=mode, session=it.session, cycles=counts)
    if is_fault or it.problem is not Problem.NONE:
        mode = ArmMode.FAULT
    elif not it.is_running:
        mode = ArmMode.IDLE
    else:
        mode = ArmMode.MOVING if max(map(abs, it.velocity)) > STANDING else ArmMode.HOLDING
    planned, egm = None, None
    with suppress(ProtocolError):  # none has come yet
        reported = SensorCodec(axes=7).decode(datagram)
        planned = reported.planned
        egm = EgmReport(
            time=reported.measured_time,
            planned_time=reported.planned_time,
            motors=reported.motors.name.lower(),
            motion=reported.mci.name.lower(),
            rapid=reported.rapid.name.lower(),
            is_converged=reported.is_converged,
            utilization=reported.utilization,
            torque=reported.torque,
            force=reported.force,
            is_collision=None if reported.collision is None else reported.collision.is_triggered,
        )
    return ArmReport(
        mode=mode,
        time=it.time + time.time() - time.monotonic(),
        session=it.session,
        position=it.position,
        velocity=it.velocity,
        planned=planned,
        sent=it.sent,
        goal=it.reference,
        pose=tool0_to_body(side, it.position),
        egm=egm,
        problem=Said.of(message(PROBLEMS[it.problem], arm=side.word)) if it.problem is not Problem.NONE else None,
        limited=it.limited,
        cycles=counts,
    )


# ---- where it is

_SUFFIX = ".sock"
_NO_FILE_NAME = re.compile(r"[^\w.:@-]")
_LONGEST_PATH = 107  # of a Unix socket [bytes]


def endpoint_folder() -> Path:
    """The folder of the sockets, which only this user may enter.

    Raises:
        RobotNotReady: it cannot be made, or others may enter it.
    """
    folder = lock_folder() / "yumi"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError as error:
        raise RobotNotReady(message("no_endpoint_folder", folder=str(folder), why=error.strerror)) from error
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o077:
        raise RobotNotReady(message("endpoint_folder_open_to_others", folder=str(folder)))
    return folder


def endpoint_path(robot: str, namespace: str = "") -> Path:
    """The socket of the driver of ``robot`` (``host:port``), in a ROS namespace if it has one.

    Raises:
        RobotNotReady: there is no folder for it, or its path is too long.
    """
    name = f"{namespace.strip('/')}@{robot}" if namespace.strip("/") else robot
    path = endpoint_folder() / f"{_NO_FILE_NAME.sub('_', name)}{_SUFFIX}"
    if len(os.fsencode(path)) > _LONGEST_PATH:
        raise RobotNotReady(message("endpoint_path_too_long", path=str(path)))
    return path


def find_driver(robot: str = "") -> Path:
    """The socket of the one driver that runs, or of the one named by its robot's address or its namespace.

    Raises:
        RobotNotReady: there is none, or more than one; the message says what to do.
    """
    drivers = {path.name.removesuffix(_SUFFIX): path for path in sorted(endpoint_folder().glob(f"*{_SUFFIX}"))}
    if len(drivers) > 1:
        drivers = {name: path for name, path in drivers.items() if _is_alive(path)}
    if not drivers:
        raise RobotNotReady(message("no_driver_runs"))
    names = {name: {name, *name.split("@"), name.rpartition("@")[2].partition(":")[0]} for name in drivers}
    chosen = [path for name, path in drivers.items() if not robot or robot.strip("/") in names[name]]
    if len(chosen) == 1:
        return chosen[0]
    if not chosen:
        raise RobotNotReady(message("no_driver_of_robot", robot=robot, drivers=tuple(drivers)))
    raise RobotNotReady(message("several_drivers_run", drivers=tuple(drivers)))


def _is_alive(path: Path) -> bool:
    try:
        _connect(path).close()
    except OSError:
        return False
    return True


def _connect(path: Path) -> socket.socket:
    """Raises OSError where no driver listens any more; what a driver that was killed has left is removed."""
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        connection.settimeout(ANSWER)
        connection.connect(os.fspath(path))
    except BaseException as error:
        connection.close()
        if isinstance(error, ConnectionRefusedError):
            path.unlink(missing_ok=True)
        raise
    return connection


# ---- the client

_T = TypeVar("_T")


class EndpointClient:
    """A connection to a running driver; one request at a time, from one thread.

    Args:
        path: of its socket, see :func:`find_driver`.

    Raises:
        RobotNotReady: the driver has ended, or takes no further client.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._socket = _connect(path)
        except (ConnectionRefusedError, FileNotFoundError) as error:
            raise RobotNotReady(message("no_driver_runs")) from error
        except OSError as error:
            raise RobotNotReady(message("driver_does_not_answer", path=str(path), why=said_by(error))) from error
        self._received = b""
        self._number = 0
        self._send(Attach(), ANSWER)

    def __enter__(self) -> EndpointClient:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Disconnect; a motion that was asked for is stopped."""
        self._socket.close()

    def ask(
        self,
        request: Request,
        result: type[_T],
        on_step: Callable[[str], None] = lambda step: None,
        on_motion: Callable[[dict[str, MotionReport]], None] = lambda motions: None,
        timeout: float | None = ANSWER,
    ) -> _T:
        """Send a request and wait for its answer.

        Args:
            request: what is asked for.
            result: the type of the answer.
            on_step: given each step of what is done.
            on_motion: given how far motions are.
            timeout: longest wait for the next line of the driver [s]; None waits for as long as it runs.

        Raises:
            YumiError: the driver refuses, or has failed to do it: the class and the sentence are the driver's.
        """
        self._number += 1
        self._send(msgspec.structs.replace(request, id=self._number), timeout)
        while True:
            answer = self._receive()
            if answer.id not in (0, self._number):
                continue
            if answer.error is not None:
                raise error_of(answer.error)
            if answer.step:
                on_step(answer.step)
            if answer.motions:
                on_motion(answer.motions)
            if answer.result:
                return self._decode(answer.result, result)

    def watch(self, rate: float) -> Iterator[DriverState]:
        """The state ``rate`` times a second, with the events since the one before; raises as :meth:`ask`."""
        self._number += 1
        self._send(Subscribe(id=self._number, rate=rate), ANSWER + 1.0 / rate)
        while True:
            answer = self._receive()
            if answer.error is not None:
                raise error_of(answer.error)
            if answer.state:
                state = self._decode(answer.state, DriverState)
                yield msgspec.structs.replace(state, events=answer.events)

    def _send(self, request: Request, timeout: float | None) -> None:
        for name in request.__struct_fields__:
            value = getattr(request, name)
            if isinstance(value, float) and not isfinite(value):  # JSON has none: it would be taken for left out
                raise errors.CommandRefused(message("value_not_finite", name=name, value=value))
        self._socket.settimeout(timeout)
        try:
            self._socket.sendall(msgspec.json.encode(request) + b"\n")
        except (BrokenPipeError, ConnectionResetError):
            return  # why it closed the connection may be there to be read
        except OSError as error:
            raise self._lost(said_by(error)) from error

    def _receive(self) -> Answer:
        while b"\n" not in self._received:
            try:
                data = self._socket.recv(1 << 16)
            except OSError as error:
                raise self._lost(said_by(error)) from error
            if not data:
                raise self._lost(message("driver_closed_connection"))
            self._received += data
        line, _, self._received = self._received.partition(b"\n")
        return self._decode(line, Answer)

    def _decode(self, data: bytes | msgspec.Raw, kind: type[_T]) -> _T:
        try:
            return msgspec.json.decode(data, type=kind)
        except msgspec.DecodeError as error:
            raise ProtocolError(message("driver_of_other_version", why=said_by(error))) from error

    def _lost(self, why: Message) -> RobotNotReady:
        return RobotNotReady(message("driver_connection_lost", name=self.path.name, why=why))


def error_of(failure: Failure) -> YumiError:
    """The exception that a driver's failure stands for."""
    kind: Any = getattr(errors, failure.kind, RobotNotReady)
    if issubclass(kind, errors.RobotNotReady | errors.GoalNotReached):
        error: YumiError = kind(failure.said.message, failure.stop)
        return error
    return (
        errors.CommandRefused(failure.said.message)
        if issubclass(kind, errors.CommandRefused)
        else YumiError(failure.said.message)
    )


def failure_of(error: YumiError) -> Failure:
    """What a client gets of an exception."""
    return Failure(type(error).__name__, Said.of(error.said), getattr(error, "stop", ""))


def sides_of(arms: Sequence[Arm]) -> tuple[Side, ...]:
    """The arms, in our order."""
    return tuple(side for side in Side if side.word in arms)
