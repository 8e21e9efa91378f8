"""Reports of a driver: states of arms, controllers, grippers, motions and log as clients get them, in SI units."""

from __future__ import annotations

import logging
import time
from collections import deque
from contextlib import suppress
from enum import Enum
from html import escape
from math import degrees
from threading import Lock
from typing import Any

import msgspec

from abb_protocols.catalogue import Message, from_wire, in_words, is_known, message, sentence, to_wire
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.egm.codec import SensorCodec
from abb_protocols.errors import ProtocolError, RobotNotReady
from abb_protocols.robot.gripper_values import GripOutcome
from abb_protocols.robot.joints import Joints, Pose, Side, abb_from_chain
from abb_protocols.robot.kinematics import tool0_to_body
from yumi.control.hand_over import Commander, Commanding
from yumi.control.motion.robot_response import STANDING
from yumi.control.shared_state import ARM_PROBLEM_CODES, ArmProblem, Limited, Snapshot
from yumi.driver.robot_state import robot_lines

_KEPT_EVENTS = 100
"""So many lines of the driver's log are kept."""

RECENT_EVENTS = 20
"""So many of them are in a state that is asked for once."""

_LEVELS = {logging.INFO: "info", logging.WARNING: "warning", logging.ERROR: "error"}


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


class CommandingReport(msgspec.Struct, frozen=True, kw_only=True):
    """Who commands an arm.

    Attributes:
        who: none, page, headset, device, lead-through, trajectory, planner, stream, policy or RAPID.
        client: whose commands they are; empty where none commands the arm.
        since: when the arm was taken over, or let go, UNIX time [s].
        is_reserved: whether the arm is kept for people until a person gives it back.
        refused: why the last request to take the arm over was refused; None once one was granted.
    """

    who: str = Commander.NONE.value
    client: str = ""
    since: float = 0.0
    is_reserved: bool = False
    refused: Said | None = None

    @classmethod
    def of(cls, commanding: Commanding) -> CommandingReport:
        """As the hand-over has it."""
        it = commanding
        since = it.since + time.time() - time.monotonic() if it.since else 0.0
        refused = None if it.refused is None else Said.of(it.refused)
        return cls(who=it.who.value, client=it.name, since=since, is_reserved=it.is_reserved, refused=refused)

    @property
    def is_of_person(self) -> bool:
        """Whether a person commands the arm, or has let it go and not given it back."""
        return Commanding(Commander(self.who), is_reserved=self.is_reserved).is_of_person

    @property
    def said(self) -> tuple[Message, ...]:
        """What there is to say of it; nothing of an arm that none commands and all may."""
        since, said = time.strftime("%H:%M:%S", time.localtime(self.since)), []
        if self.who != Commander.NONE.value:
            said.append(message("commanded_since", who=self.who, client=self.client, since=since))
        if self.is_reserved:
            said.append(message("reserved_for_person"))
        if self.refused is not None:
            said.append(message("last_take_over_refused", reason=self.refused.message))
        return tuple(said)


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
        command: who commands it.
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
    command: CommandingReport = CommandingReport()


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


class EventLog:
    """The newest lines of the driver's log, for its clients; safe from any thread.

    Attributes:
        count: the number of the newest line.
    """

    def __init__(self) -> None:
        self.count = 0
        self._events: deque[EventReport] = deque(maxlen=_KEPT_EVENTS)
        self._lock = Lock()

    def note(self, level: int, said: Message | str) -> None:
        """Keep a line, with a level of :mod:`logging`; none for debugging."""
        if level < logging.INFO:
            return
        with self._lock:
            self.count += 1
            self._events.append(EventReport(self.count, time.time(), _LEVELS.get(level, "info"), Said.of(said)))

    def since(self, number: int) -> tuple[EventReport, ...]:
        """The lines after ``number`` that are still there."""
        with self._lock:
            return tuple(event for event in self._events if event.number > number)


class DriverState(msgspec.Struct, frozen=True, kw_only=True):
    """A driver with its robot, now. What is unknown is None.

    Attributes:
        time: UNIX time [s].
        robot: its address.
        process: number of the driver's process.
        sessions: how often the controller has let the driver in; since it last grew, another one may answer.
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
    sessions: int = 0
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

    def planning_start(self) -> dict[Side, Joints]:
        """Where both arms are, for a motion that is planned from there [rad], (7,) each.

        Raises:
            RobotNotReady: EGM does not report where an arm is.
        """
        start = {}
        for side in Side:
            position = self.arms[side.word].position
            if position is None:
                raise RobotNotReady(message("plan_without_position", arm=side.word))
            start[side] = position
        return start

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
        if arm.command.said:
            lines.append(f"  {in_words(arm.command.said)}")
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


class GripReport(msgspec.Struct, frozen=True):
    """How a grip ended, and the distance between the fingers then [m]."""

    outcome: GripOutcome
    width: float
    arm: str

    def __str__(self) -> str:
        held = f" something {self.width * 1e3:.1f} mm wide" if self.outcome is GripOutcome.HOLDING else ""
        return f"The {self.arm} gripper is {self.outcome.value}{held}."


class MotionReport(msgspec.Struct, frozen=True):
    """How far a motion is: from 0 to 1, and the time it still takes [s], as far as that is known."""

    progress: float
    remaining: float | None


def arm_report(
    side: Side,
    snapshot: Snapshot,
    datagram: bytes = b"",
    commanding: Commanding = Commanding(),  # noqa: B008 - it is frozen
    *,
    is_fault: bool = False,
) -> ArmReport:
    """An arm as its control loop's ``snapshot`` and its robot's newest ``datagram`` show it, and who commands it."""
    it, command = snapshot, CommandingReport.of(commanding)
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
        return ArmReport(mode=mode, session=it.session, cycles=counts, command=command)
    if is_fault or it.problem is not ArmProblem.NONE:
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
        problem=Said.of(message(ARM_PROBLEM_CODES[it.problem], arm=side.word))
        if it.problem is not ArmProblem.NONE
        else None,
        limited=it.limited,
        cycles=counts,
        command=command,
    )
