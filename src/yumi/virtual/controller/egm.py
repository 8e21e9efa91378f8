"""EGM on the robot's side for one arm: what RAPID's EGM instructions do, and one datagram per cycle.

The order within a cycle is the controller's (reference/egm.md §4.3): read feedback, send, take at most one datagram
of the sensor, hand its reference to the arm. Which datagram is next, and what ends a session, is in ``egm_session``.

What the arm tells the sensor in one datagram (reference/egm.md §3).

The lines between the arms and their sensors, and what can go wrong on them; they advance by dt.

What kind of controller the robot's side of EGM is: its datagrams, its clock, its faults.

One EGM session on the robot's side: its counters, its queue, and when it is over.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum, IntEnum, auto
from math import degrees, inf, isfinite, radians
from random import Random
from typing import NamedTuple, cast

from yumi.egm.codec import RobotCodec, SensorCodec
from yumi.egm.messages import MciState, MotorState, PartialJoints, RapidState, RobotMessage
from yumi.errors import CommandRefused, ProtocolError, RobotNotReady
from yumi.robot.joints import CYCLE, ZERO, JointLimits, Joints, Pose, Side, joint_names
from yumi.robot.kinematics import compose, inverse, tool0_to_body
from yumi.virtual.controller.fault_names import Fault, Way
from yumi.virtual.mechanics.arm import (
    Axes,
    Bands,
    EgmActivation,
    EgmRun,
    ExternalMotionData,
    Overload,
    StopMode,
    VirtualArm,
    law_settings,
)

VIRTUAL_CYCLE = 0.004
"""Period of ABB's own virtual controller [s]."""


class RobotWare(Enum):
    """Whose datagrams the arm sends (reference/egm.md §1.4)."""

    RW_6_09 = auto()
    RW_6_10 = auto()


class InvalidReference(Enum):
    """What a reference that is no finite number does."""

    SYSTEM_FAILURE = auto()
    """The controller fails and has to be restarted, as real ones did (reference/egm.md §4.5)."""

    REJECT = auto()
    """The datagram is left aside and counted."""


@dataclass(frozen=True, slots=True)
class EgmOptions:
    """Options of one arm's EGM client.

    Attributes:
        robotware: whose profile the datagrams have.
        cycle_time: period of motion control [s].
        queue_length: datagrams the operating system keeps for a reader that takes one per cycle; the newest beyond
            are lost.
        invalid_reference: what NaN and infinity do.
        tells_rapid_state: False for the fault some controllers have after a restart: their datagrams call RAPID's
            state undefined, whatever it is (reference/egm.md §3.3).
    """

    robotware: RobotWare = RobotWare.RW_6_09
    cycle_time: float = CYCLE
    queue_length: int = 256
    invalid_reference: InvalidReference = InvalidReference.SYSTEM_FAILURE
    tells_rapid_state: bool = True


@dataclass(slots=True)
class EgmSession:
    """From the first datagram, number 0, to the last.

    Attributes:
        is_guided: whether EGMRun made it, so that replies move the arm; a position stream otherwise.
        cycles_per_datagram: SampleRate in cycles.
        queue_length: how many datagrams can wait for their cycle; the newest beyond are lost.
        cycle: cycles since the session began.
        seqno: number of the next datagram.
        mci: state that the next datagram tells.
        is_over: whether the next datagram is the last.
        has_sensor: whether any datagram of the sensor was accepted.
        silence: time since the sensor was last heard, or since the start [s].
        is_in_band: whether all selected joints are in their convergence bands.
        time_in_band: how long they have been there without a break [s].
        queue: datagrams that wait for their cycle, oldest first.
    """

    is_guided: bool
    cycles_per_datagram: int = 1
    queue_length: int = 256
    cycle: int = -1
    seqno: int = 0
    mci: MciState = MciState.STOPPED
    is_over: bool = False
    has_sensor: bool = False
    silence: float = 0.0
    is_in_band: bool = False
    time_in_band: float = 0.0
    queue: deque[bytes] = field(default_factory=deque)

    @property
    def is_due(self) -> bool:
        """Whether EGM exchanges datagrams in this cycle."""
        return self.is_over or self.cycle % self.cycles_per_datagram == 0

    def advance(self, dt: float, inbox: Iterable[bytes]) -> None:
        """Begin the next cycle with the datagrams that arrived since the last."""
        self.cycle += 1
        self.silence += dt if self.cycle else 0.0
        for datagram in inbox:
            if len(self.queue) < self.queue_length:
                self.queue.append(datagram)

    def next_seqno(self) -> int:
        seqno = self.seqno
        self.seqno += 1
        return seqno

    def hear(self) -> None:
        """Note that the sensor is alive."""
        self.has_sensor = True
        self.silence = 0.0

    def end(self, mci: MciState) -> None:
        """Let the next datagram be the last and tell ``mci``."""
        self.is_over, self.mci = True, mci

    def dwell(self, dt: float, *, is_in_band: bool) -> None:
        """Count the time in the convergence bands; it begins when the sensor has been heard."""
        self.time_in_band = self.time_in_band + dt if is_in_band and self.has_sensor else 0.0
        self.is_in_band = is_in_band

    def has_converged(self, cond_time: float) -> bool:
        """Whether the joints have been in their bands for ``cond_time`` [s]."""
        return self.is_in_band and self.has_sensor and self.time_in_band >= cond_time


def in_bands(ordered: Joints, measured: Joints, bands: Bands, axes: Axes) -> bool:
    """Whether every selected joint is within its band around the ordered position."""
    return all(
        low <= is_at - goal <= high
        for goal, is_at, (low, high), selected in zip(ordered, measured, bands, axes, strict=True)
        if selected
    )


FEEDBACK_AGE = 0.0045
"""How much older than its datagram a measured position is [s] (reference/egm.md §2.3)."""


def feedback(
    arm: VirtualArm,
    session: EgmSession,
    activation: EgmActivation,
    rapid: RapidState,
    *,
    now: float,
    robotware: RobotWare,
) -> RobotMessage:
    """The next datagram of ``session`` as a value, sent at controller time ``now`` [s]."""
    measured_time = now - FEEDBACK_AGE
    return RobotMessage(
        seqno=session.next_seqno(),
        sent_ms=int(now * 1000.0) % 2**32,
        measured=arm.position,
        planned=arm.planned,
        measured_pose=_tool_pose(arm.side, arm.position, activation),
        planned_pose=_tool_pose(arm.side, arm.planned, activation),
        measured_time=measured_time,
        planned_time=measured_time + arm.reaction_time,
        motors=MotorState.ON if arm.motors_on else MotorState.OFF,
        mci=session.mci,
        rapid=rapid,
        is_converged=session.is_in_band,
        utilization=_utilization(arm) if robotware is RobotWare.RW_6_10 else None,
    )


def _tool_pose(side: Side, position: Joints, activation: EgmActivation) -> Pose:
    pose = tool0_to_body(side, position, activation.tool)
    return pose if activation.wobj is None else compose(inverse(activation.wobj), pose)


def _utilization(arm: VirtualArm) -> float:
    return 0.0 if arm.egm is None else arm.egm.utilization


CLOCK_START = 28_800.0
"""What the controller's clock shows at the first cycle: that of one switched on in the morning [s]."""

_ROUNDING = 1e-4  # a reference in rounded degrees may lie this far beyond a limit in rounded radians [rad]


class EgmState(IntEnum):
    """``egmstate`` of RAPID; the examples of the manual compare with <=, so the order counts."""

    DISCONNECTED = 0
    CONNECTED = 1
    RUNNING = 2


class EgmOutcome(Enum):
    """What became of the last EGMRunJoint."""

    RUNNING = auto()
    CONVERGED = auto()
    STOPPED = auto()
    COMM_TIMEOUT = auto()
    OUT_OF_BOUNDS = auto()
    OVERLOADED = auto()
    SYSTEM_FAILURE = auto()
    MOTORS_OFF = auto()
    ABORTED = auto()


@dataclass(frozen=True, slots=True)
class EgmFailure:
    """What ended a run so that the controller itself has to act, not only the program that waits for the end.

    Attributes:
        outcome: what became of the run.
        sentence: why, for the event log.
    """

    outcome: EgmOutcome
    sentence: str


class EgmClient:
    """The EGM client of one arm, between its RAPID task, its motion and the wire.

    Args:
        arm: the arm that EGM guides.
        options: what kind of controller it belongs to.

    Attributes:
        state: what EGMGetState returns.
        outcome: what became of the last :meth:`run_joint`; None before the first.
        fault: why the session ended by itself, a sentence for the event log; empty when it did not.
        rapid: RAPID's execution state as the datagrams tell it.
        ignored_datagrams: how many datagrams of the sensor could not be decoded, or were rejected.
    """

    def __init__(self, arm: VirtualArm, options: EgmOptions | None = None) -> None:
        self.state = EgmState.DISCONNECTED
        self.outcome: EgmOutcome | None = None
        self.fault = ""
        self.rapid = RapidState.RUNNING
        self.ignored_datagrams = 0
        self._arm = arm
        self._options = options or EgmOptions()
        self._cycles = 0
        self._failure: EgmFailure | None = None
        self._codec = RobotCodec()
        self._bounds = _widened(arm.model.limits)
        self._session: EgmSession | None = None
        self._comm_timeout = 1.0
        self._data = ExternalMotionData()
        self._activation = EgmActivation()
        self._run = EgmRun()

    # What RAPID does

    def get_id(self) -> None:
        """EGMGetId: reserve the identity; nothing happens when it is reserved."""
        self.state = max(self.state, EgmState.CONNECTED)

    def setup(self, comm_timeout: float = 1.0, ext_config: ExternalMotionData | None = None) -> None:
        """EGMSetupUC for joint motion: how long the sensor may be silent [s], and the system parameters.

        Raises:
            RobotNotReady: there is no identity yet, or EGM runs.
        """
        self._check_state(EgmState.CONNECTED)
        self._comm_timeout = comm_timeout
        self._data = ext_config or ExternalMotionData()

    def activate(self, activation: EgmActivation) -> None:
        """EGMActJoint: the settings of the runs that follow.

        Raises:
            RobotNotReady: there is no identity yet, or EGM runs.
        """
        self._check_state(EgmState.CONNECTED)
        self._activation = activation

    def run_joint(self, run: EgmRun) -> None:
        """EGMRunJoint: begin a session; :attr:`outcome` tells how it ends. Without any axis nothing begins.

        The arm may still be decelerating when the outcome is there: wait for its ``is_stationary``.

        Raises:
            RobotNotReady: there is no identity yet, EGM guides the arm already, or the motors are off.
        """
        self.stream_stop()  # a stream ends where a run begins
        self._check_state(EgmState.CONNECTED)
        self.fault = ""
        if not any(run.axes):
            self.outcome = EgmOutcome.CONVERGED
            return
        self._arm.start_egm(law_settings(self._data, self._activation, run))
        self._run = run
        self.outcome = EgmOutcome.RUNNING
        self._begin(self._activation.sample_rate_ms, is_guided=True)

    def stop(self, mode: StopMode = StopMode.HOLD, ramp_out_time: float = 1.0) -> None:
        """EGMStop: end the run; with RAMP_DOWN the arm goes back to where it began, in ``ramp_out_time`` [s]."""
        if self._guided() is not None:
            self._finish(EgmOutcome.STOPPED, mode, ramp_out_time)

    def abort(self) -> None:
        """The program stops: EGM's speed goes to zero within the configured ramp time, the session ends.

        Run again with :meth:`run_joint` when the program goes on.
        """
        if self._guided() is not None:
            self._arm.stop_egm(self._data.ramp_time)
            self._end(EgmOutcome.ABORTED if self._arm.motors_on else EgmOutcome.MOTORS_OFF, MciState.STOPPED)
        self.stream_stop()

    def stream_start(self, sample_rate_ms: int = 4) -> None:
        """EGMStreamStart: send positions; replies are not used.

        Raises:
            RobotNotReady: there is no identity yet, or EGM runs.
        """
        self._check_state(EgmState.CONNECTED)
        self._begin(sample_rate_ms, is_guided=False)

    def stream_stop(self) -> None:
        """EGMStreamStop: end a position stream; a guided run goes on."""
        if self._session is not None and not self._session.is_guided and not self._session.is_over:
            self._session.end(MciState.STOPPED)
            self.state = EgmState.CONNECTED

    def reset(self) -> None:
        """EGMReset: end whatever runs and give the identity back."""
        self.stop()
        self.stream_stop()
        self.state = EgmState.DISCONNECTED

    def power_down(self) -> None:
        """The controller restarts: the session ends without a word, the identity is gone."""
        self.abort()
        self._session = None
        self.state = EgmState.DISCONNECTED

    def lose_sensor(self) -> None:
        """End the run as if nothing had been heard for CommTimeout; nothing happens when EGM does not guide."""
        session = self._guided()
        if session is not None:
            session.silence = inf

    def converge(self) -> None:
        """End the run as if the convergence criteria were met; nothing happens when EGM does not guide."""
        if self._guided() is not None:
            self._finish(EgmOutcome.CONVERGED, self._run.stop_mode, self._run.ramp_out_time)

    def overload(self) -> None:
        """End the run as if the reference asked too much of a drive; nothing happens when EGM does not guide."""
        if self._guided() is not None:
            name = joint_names(self._arm.side)[1]
            self._shut_down(EgmOutcome.OVERLOADED, f"The EGM reference needs more than the drive of {name} gives.")

    @property
    def is_guiding(self) -> bool:
        """Whether EGM guides the arm."""
        return self._guided() is not None

    @property
    def resumes(self) -> bool:
        """Whether the run is going on, or will when the program that was interrupted does."""
        survives = (EgmOutcome.RUNNING, EgmOutcome.ABORTED)
        return self.outcome in survives or self._data.restarts_after_motors_off

    def take_failure(self) -> EgmFailure | None:
        """What the controller has to act on, once."""
        failure, self._failure = self._failure, None
        return failure

    # What motion control does

    def cycle(self, inbox: Sequence[bytes] = ()) -> bytes | None:
        """One cycle of motion control; advance the arm afterwards.

        Args:
            inbox: datagrams that arrived since the last cycle, oldest first.

        Returns:
            The datagram for the sensor, or None when there is nothing to send.
        """
        self._cycles += 1
        session = self._session
        if session is None:
            return None
        session.advance(self._options.cycle_time, inbox)
        self._supervise(session)
        if not session.is_due:
            return None
        datagram = self._datagram(session)
        if session.is_over:
            self._session = None
        else:
            self._accept_next(session)
        return datagram

    def _guided(self) -> EgmSession | None:
        session = self._session
        return session if session is not None and session.is_guided and not session.is_over else None

    def _check_state(self, needed: EgmState) -> None:
        if self.state is not needed:
            raise RobotNotReady(
                f"EGM of the {self._arm.side.word} arm is {self.state.name.lower()}: "
                f"it has to be {needed.name.lower()} for this."
            )

    def _begin(self, sample_rate_ms: int, *, is_guided: bool) -> None:
        mci = MciState.RUNNING if is_guided else MciState.STOPPED
        self._session = EgmSession(
            is_guided,
            cycles_per_datagram=max(1, sample_rate_ms // 4),
            queue_length=self._options.queue_length,
            mci=mci,
        )
        self.state = EgmState.RUNNING

    def _finish(self, outcome: EgmOutcome, mode: StopMode, ramp_out_time: float) -> None:
        """End the run as its stop mode says; with HOLD the ramp means nothing (reference/egm.md §4.6)."""
        returns = mode is StopMode.RAMP_DOWN
        self._arm.stop_egm(ramp_out_time if returns else 0.0, returns_to_start=returns)
        self._end(outcome, MciState.STOPPED)

    def _fail(self, outcome: EgmOutcome, sentence: str, ramp_time: float = 0.0) -> None:
        self.fault = sentence
        self._arm.stop_egm(ramp_time)
        self._end(outcome, MciState.ERROR)

    def _end(self, outcome: EgmOutcome, mci: MciState) -> None:
        if self._session is not None:
            self._session.end(mci)
        self.outcome = outcome
        self.state = EgmState.CONNECTED

    def _supervise(self, session: EgmSession) -> None:
        """End a run that ends without an instruction."""
        egm = self._arm.egm
        if not session.is_guided or session.is_over:
            return
        if egm is None or not self._arm.motors_on:
            self.fault = f"The {self._arm.side.word} arm was stopped while EGM was running."
            self.abort()
        elif session.silence > self._comm_timeout:
            sentence = f"No data from the UdpUc device for {self._comm_timeout:g} s (41822)."
            self._fail(EgmOutcome.COMM_TIMEOUT, sentence, self._data.ramp_time)
            if not self._run.is_waited:
                self._failure = EgmFailure(EgmOutcome.COMM_TIMEOUT, sentence)
        elif self._arm.overload is not None:
            self._shut_down(EgmOutcome.OVERLOADED, self._too_much(self._arm.overload))
        elif self._bounds.outside(self._arm.planned) is not None:
            self._leave_bounds(self._arm.planned)
        else:
            self._check_convergence(session, egm.reference)

    def _check_convergence(self, session: EgmSession, ordered: Joints) -> None:
        run = self._run
        is_in_band = in_bands(ordered, self._arm.position, self._activation.cond_min_max, run.axes)
        session.dwell(self._options.cycle_time, is_in_band=is_in_band)
        if session.has_converged(run.cond_time):
            self._finish(EgmOutcome.CONVERGED, run.stop_mode, run.ramp_out_time)

    def _accept_next(self, session: EgmSession) -> None:
        if not session.queue:
            return
        try:
            message = self._codec.decode(session.queue.popleft())
        except ProtocolError:
            self.ignored_datagrams += 1
            return
        rejects = self._options.invalid_reference is InvalidReference.REJECT
        if rejects and not _is_finite(message.position, message.velocity):
            self.ignored_datagrams += 1
            return
        session.hear()
        if session.is_guided:
            self._order(message.position, message.velocity)

    def _order(self, position: PartialJoints | None, velocity: PartialJoints | None) -> None:
        egm = self._arm.egm
        if egm is None:
            return
        goal = None if position is None else _completed(position, egm.reference)
        speed = None if velocity is None else _completed(velocity, ZERO)
        if not _is_finite(goal, speed):
            self._shut_down(
                EgmOutcome.SYSTEM_FAILURE,
                f"The {self._arm.side.word} arm got an EGM reference that is no finite number.",
            )
        elif goal is not None and self._run.pos_corr_gain > 0.0 and self._bounds.outside(goal) is not None:
            self._leave_bounds(goal)
        else:
            self._arm.set_reference(goal, speed)

    def _leave_bounds(self, position: Joints) -> None:
        index = self._bounds.outside(position) or 0
        name, range_deg = joint_names(self._arm.side)[index], self._arm.model.limits.range_deg(index)
        at_deg = degrees(position[index])
        sentence = f"External Motion Interface input out of bounds: {name} at {at_deg:.1f}°, range {range_deg}."
        self._shut_down(EgmOutcome.OUT_OF_BOUNDS, sentence)

    def _too_much(self, overload: Overload) -> str:
        name = joint_names(self._arm.side)[overload.joint]
        return (
            f"The EGM reference needs {overload.torque:.0f} N m at {name}, whose drive gives {overload.limit:.0f} N m: "
            "limit the acceleration of the reference."
        )

    def _shut_down(self, outcome: EgmOutcome, sentence: str) -> None:
        """What the real controller answers with motors off, or with more (reference/egm.md §4.5)."""
        self._fail(outcome, sentence)
        self._arm.switch_motors_off()
        self._failure = EgmFailure(outcome, sentence)

    def _datagram(self, session: EgmSession) -> bytes:
        options = self._options
        now = CLOCK_START + self._cycles * options.cycle_time
        rapid = self.rapid if options.tells_rapid_state else RapidState.UNDEFINED
        message = feedback(self._arm, session, self._activation, rapid, now=now, robotware=options.robotware)
        return self._codec.encode(message)


def _completed(values: PartialJoints, last: Joints) -> Joints:
    """Axes the sensor left out keep their last value (reference/egm.md §10 item 18)."""
    complete = tuple(old if new is None else new for new, old in zip(values, last, strict=True))
    return cast("Joints", complete)


def _is_finite(*parts: PartialJoints | None) -> bool:
    return all(isfinite(value) for part in parts for value in part or () if value is not None)


def _widened(limits: JointLimits) -> JointLimits:
    lower = cast("Joints", tuple(value - _ROUNDING for value in limits.lower))
    upper = cast("Joints", tuple(value + _ROUNDING for value in limits.upper))
    return replace(limits, lower=lower, upper=upper)


REMEMBERED = 1000
"""Datagrams of an arm that can come a second time."""

_MS = 1e-3
_EGM_LINE_ROUNDING = 1e-6  # of times [s]
_VARINT, _FIXED64, _LENGTH = 0, 1, 2  # wire types of Protocol Buffers; 5, the only other one, has four bytes


FORGED = {Fault.EGM_FORGE: 1, Fault.EGM_FORGE_OLD: -100, Fault.EGM_FORGE_AHEAD: 1000}
"""By so much the number of a forged datagram is higher than that of the arm's last."""

SINGLE = (Fault.EGM_STALE, *FORGED)
"""Faults that are one more datagram."""

LASTING = (
    Fault.EGM_LOSS,
    Fault.EGM_DELAY,
    Fault.EGM_DUPLICATE,
    Fault.EGM_REORDER,
    Fault.EGM_TRUNCATE,
    Fault.EGM_OFFSET,
    Fault.EGM_SWAP_ARMS,
    Fault.EGM_FOREIGN_PORT,
)
"""Faults that change the datagrams for a time."""


class Departure(NamedTuple):
    """A datagram on its way to the driver.

    Attributes:
        side: to the port of which arm it goes.
        datagram: the bytes.
        is_foreign: whether it leaves from another port than the arm's.
    """

    side: Side
    datagram: bytes
    is_foreign: bool = False


class _Effect(NamedTuple):
    """A fault that lasts: how strong it is, which way, and until when [s]."""

    amount: float
    way: Way
    until: float


class _Once(NamedTuple):
    """A datagram that is sent beside the arm's own, with its next."""

    fault: Fault
    amount: float


class EgmLines:
    """Carries the datagrams of both arms, each on a line of its own.

    The same calls give the same datagrams: chance has a seed. What is delayed leaves in whole cycles of the robot.

    Args:
        cycle_time: of the robot [s].
        seed: of what is lost, reordered and cut at random.
    """

    def __init__(self, cycle_time: float = CYCLE, seed: int = 0) -> None:
        self._cycle_time = cycle_time
        self._random = Random(seed)
        self._now = 0.0
        self._effects: dict[tuple[Fault, Side], _Effect] = {}
        self._once: dict[Side, list[_Once]] = {side: [] for side in Side}
        self._sent: dict[Side, deque[bytes]] = {side: deque(maxlen=REMEMBERED) for side in Side}
        self._under_way: dict[tuple[Way, Side], list[tuple[float, bytes]]] = {}
        self._count = dict.fromkeys(Side, 0)
        self._reader, self._writer = SensorCodec(axes=7), RobotCodec()

    def put(
        self, fault: Fault, side: Side, amount: float = 0.0, way: Way = Way.BOTH, duration: float | None = None
    ) -> None:
        """Let a fault of the line happen; it replaces one of the same kind.

        Args:
            fault: which.
            side: on the line of which arm.
            amount: how strong, in the unit of its kind; 0 is chance where :data:`Fault.EGM_TRUNCATE` cuts.
            way: in which direction.
            duration: how long it lasts [s]; None for ever.

        Raises:
            CommandRefused: the arm has not sent the datagram that shall come again.
        """
        if fault in SINGLE:
            if fault is Fault.EGM_STALE and len(self._sent[side]) < amount:
                count = len(self._sent[side])
                raise CommandRefused(
                    f"The {side.word} arm has sent only {count} EGM datagrams, not {amount:g}; let it send more first."
                )
            self._once[side].append(_Once(fault, amount))
        else:
            self._effects[fault, side] = _Effect(amount, way, self._now + (inf if duration is None else duration))

    def repair(self, side: Side) -> None:
        """Let all datagrams of an arm through as they are; what is under way is lost."""
        self._effects = {(fault, each): one for (fault, each), one in self._effects.items() if each is not side}
        self._once[side].clear()
        for way in Way:
            self._under_way.pop((way, side), None)

    def amount(self, fault: Fault, side: Side, way: Way = Way.BOTH) -> float | None:
        """How strong a fault is on the line of an arm in a direction; None where there is none."""
        effect = self._effects.get((fault, side))
        return effect.amount if effect is not None and effect.way in (way, Way.BOTH) else None

    def advance(self, dt: float) -> None:
        """Begin the next cycle, ``dt`` [s] after the last: faults whose time is over end."""
        now = self._now = self._now + dt
        if self._effects:
            self._effects = {
                key: effect for key, effect in self._effects.items() if effect.until > now + _EGM_LINE_ROUNDING
            }

    def arriving(self, inboxes: Mapping[Side, Sequence[bytes]]) -> Mapping[Side, Sequence[bytes]]:
        """What of the driver's datagrams reaches the arms in this cycle."""
        return {side: self._carry(Way.TO_ROBOT, side, inboxes.get(side, ())) for side in Side}

    def leaving(self, datagrams: Mapping[Side, bytes]) -> list[Departure]:
        """What goes to the driver in this cycle, in its order, when the arms send ``datagrams``."""
        departures: list[Departure] = []
        for side in Side:
            fresh = self._made(side, datagrams[side]) if side in datagrams else ()
            to = side if self.amount(Fault.EGM_SWAP_ARMS, side) is None else side.other
            for datagram in self._carry(Way.FROM_ROBOT, side, fresh):
                if self.amount(Fault.EGM_FOREIGN_PORT, side) is not None:
                    departures.append(Departure(to, datagram, is_foreign=True))
                departures.append(Departure(to, datagram))
        return departures

    def _made(self, side: Side, datagram: bytes) -> Iterable[bytes]:
        """What is sent in place of and beside a datagram of an arm."""
        sent = self._sent[side]
        sent.append(datagram)
        self._count[side] += 1
        beside = [self._once_sent(one, sent) for one in self._once[side]]
        self._once[side].clear()
        offset = self.amount(Fault.EGM_OFFSET, side)
        if offset is not None:
            datagram = self._forged(datagram, offset, ahead=0)
        kept = self.amount(Fault.EGM_TRUNCATE, side)
        if kept is not None and self._count[side] % 2:
            datagram = datagram[: int(kept) or self._random.choice(field_borders(datagram))]
        return (datagram, *beside)

    def _once_sent(self, one: _Once, sent: Sequence[bytes]) -> bytes:
        if one.fault is Fault.EGM_STALE:
            return sent[-1 - int(one.amount)]
        return self._forged(sent[-1], one.amount, FORGED[one.fault])

    def _forged(self, datagram: bytes, offset_deg: float, ahead: int) -> bytes:
        """A datagram with all joints elsewhere, and the number ``ahead`` of it; its time is the next cycle's then."""
        message, offset = self._reader.decode(datagram), radians(offset_deg)
        later = self._cycle_time if ahead else 0.0
        return self._writer.encode(
            replace(
                message,
                seqno=max(0, message.seqno + ahead),
                measured=tuple(value + offset for value in message.measured),
                planned=tuple(value + offset for value in message.planned),
                measured_time=message.measured_time + later,
                planned_time=None if message.planned_time is None else message.planned_time + later,
            )
        )

    def _carry(self, way: Way, side: Side, fresh: Iterable[bytes]) -> Sequence[bytes]:
        """What of ``fresh``, and of what was under way, arrives now in one direction."""
        if not self._effects and not self._under_way:
            return tuple(fresh)
        loss = self.amount(Fault.EGM_LOSS, side, way) or 0.0
        delay = (self.amount(Fault.EGM_DELAY, side, way) or 0.0) * _MS
        copies = int(self.amount(Fault.EGM_DUPLICATE, side, way) or 0.0)
        disorder = int(self.amount(Fault.EGM_REORDER, side, way) or 0.0)
        line = self._under_way.pop((way, side), [])
        for datagram in fresh:
            if 100.0 * self._random.random() < loss:
                continue
            for _ in range(1 + copies):
                held = self._random.randint(0, disorder) * self._cycle_time
                line.append((self._now + delay + held, datagram))
        latest = self._now + _EGM_LINE_ROUNDING
        later = [each for each in line if each[0] > latest]
        if later:
            self._under_way[way, side] = later
        return [datagram for due, datagram in sorted(line, key=lambda each: each[0]) if due <= latest]


def field_borders(datagram: bytes) -> Sequence[int]:
    """Where the fields of a Protocol Buffers message end, each but the last [bytes]; 0 where it has one at most."""
    borders, at = [0], 0
    while at < len(datagram):
        kind = datagram[at] & 7
        _, at = _varint(datagram, at)
        if kind == _VARINT:
            _, at = _varint(datagram, at)
        elif kind == _LENGTH:
            length, at = _varint(datagram, at)
            at += length
        else:
            at += 8 if kind == _FIXED64 else 4
        borders.append(at)
    return borders[1:-1] or [0]


def _varint(datagram: bytes, at: int) -> tuple[int, int]:
    """A number of seven bits in each byte, the lowest first, and where it ends."""
    value = shift = 0
    while datagram[at] & 0x80:
        value |= (datagram[at] & 0x7F) << shift
        at, shift = at + 1, shift + 7
    return value | datagram[at] << shift, at + 1
