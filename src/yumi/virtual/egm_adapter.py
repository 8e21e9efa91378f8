"""EGM on the robot's side for one arm: what RAPID's EGM instructions do, and one datagram per cycle.

The order within a cycle is the controller's (reference/egm.md §4.3): read feedback, send, take at most one datagram
of the sensor, hand its reference to the arm. Which datagram is next, and what ends a session, is in ``egm_session``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum, IntEnum, auto
from math import degrees, inf, isfinite
from typing import cast

from yumi.egm.codec import RobotCodec
from yumi.egm.messages import MciState, PartialJoints, RapidState
from yumi.errors import ProtocolError, RobotNotReady
from yumi.robot.joints import Joints, joint_names
from yumi.robot.limits import JointLimits
from yumi.robot.values import ZERO
from yumi.virtual.arm import VirtualArm
from yumi.virtual.arm_load import Overload
from yumi.virtual.egm_feedback import feedback
from yumi.virtual.egm_options import EgmOptions, InvalidReference
from yumi.virtual.egm_session import EgmSession, in_bands
from yumi.virtual.egm_settings import EgmActivation, EgmRun, ExternalMotionData, StopMode, law_settings

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
