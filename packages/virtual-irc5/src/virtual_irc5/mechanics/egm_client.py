"""The EGM client of one arm: what RAPID's EGM instructions do, and a datagram per cycle.

The order within a cycle is the controller's (reference/egm.md §4.3): read feedback, send, take the sensor's newest
datagram, hand its reference to the arm.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum, IntEnum, auto
from math import degrees, hypot, inf, isfinite

import numpy as np

from abb_protocols.egm.codec import MciState, MotorState, PartialJoints, RapidState, RobotCodec, RobotMessage
from abb_protocols.errors import ProtocolError, RobotNotReady
from abb_protocols.robot.joints import CYCLE, Joints, Pose, Quaternion, Vector
from abb_protocols.robot.kinematics import compose_poses, inverse_pose, matrix_from_quaternion
from abb_protocols.robot.rotations import rotation_vectors
from virtual_irc5.mechanics.arm import VirtualArm
from virtual_irc5.mechanics.egm_motion import (
    DEFAULT_BANDS,
    EgmActivation,
    EgmMotionParameters,
    EgmRun,
    EgmStopMode,
    ExternalMotionData,
)
from virtual_irc5.mechanics.path import Passage


class EgmRobotWare(Enum):
    """Whose datagrams the arm sends (reference/egm.md §1.4)."""

    RW_6_09 = auto()
    RW_6_10 = auto()


class InvalidEgmReference(Enum):
    """Reaction to a reference that is not a finite number."""

    SYSTEM_FAILURE = auto()
    """The controller fails and has to be restarted, as real ones did (reference/egm.md §4.5)."""

    REJECT = auto()
    """The datagram is ignored and counted."""


@dataclass(frozen=True, slots=True)
class EgmOptions:
    """Options of one arm's EGM client.

    Attributes:
        robotware: whose profile the datagrams have.
        cycle_time: period of motion control [s].
        invalid_reference: what NaN and infinity do.
        sends_rapid_state: False for the defect some controllers have after a restart: RAPID's state in their datagrams
            is always undefined (reference/egm.md §3.3).
    """

    robotware: EgmRobotWare = EgmRobotWare.RW_6_09
    cycle_time: float = CYCLE
    invalid_reference: InvalidEgmReference = InvalidEgmReference.SYSTEM_FAILURE
    sends_rapid_state: bool = True


class _EgmUse(Enum):
    """What the datagrams of a session are for."""

    STREAM = auto()
    """Positions are sent, and replies are not used (EGMStreamStart)."""

    GUIDANCE = auto()
    """Replies are references for the arm (EGMRunJoint, EGMRunPose)."""

    PATH_CORRECTION = auto()
    """Replies are offsets beside the path of the program (EGMMoveL, EGMMoveC)."""


@dataclass(slots=True)
class _EgmSession:
    """From the first datagram, number 0, to the last.

    Attributes:
        use: what its datagrams are for.
        cycles_per_datagram: SampleRate in cycles.
        cycle: cycles since the session began.
        seqno: number of the next datagram.
        mci: state in the next datagram.
        is_over: whether the next datagram is the last.
        has_sensor: whether any datagram of the sensor was accepted.
        silence: time since the last datagram of the sensor, or since the start [s].
        is_in_band: whether all selected joints are in their convergence bands.
        time_in_band: how long they have been there without a break [s].
        newest: the sensor's last datagram that no cycle has taken; None when there is none.
    """

    use: _EgmUse
    cycles_per_datagram: int = 1
    cycle: int = -1
    seqno: int = 0
    mci: MciState = MciState.STOPPED
    is_over: bool = False
    has_sensor: bool = False
    silence: float = 0.0
    is_in_band: bool = False
    time_in_band: float = 0.0
    newest: bytes | None = None

    @property
    def is_due(self) -> bool:
        """Whether EGM exchanges datagrams in this cycle."""
        return self.is_over or self.cycle % self.cycles_per_datagram == 0

    def advance(self, dt: float, inbox: Iterable[bytes]) -> None:
        """Begin the next cycle with the datagrams that arrived since the last; the newest one counts."""
        self.cycle += 1
        self.silence += dt if self.cycle else 0.0
        for datagram in inbox:
            self.newest = datagram

    def note_sensor(self) -> None:
        """A datagram of the sensor was accepted."""
        self.has_sensor = True
        self.silence = 0.0

    def end(self, mci: MciState) -> None:
        """The next datagram is the last, with state ``mci``."""
        self.is_over, self.mci = True, mci


class EgmClientState(IntEnum):
    """``egmstate`` of RAPID; the examples of the manual compare with <=, so the order counts."""

    DISCONNECTED = 0
    CONNECTED = 1
    RUNNING = 2


class EgmOutcome(Enum):
    """How the last EGMRunJoint, or the correction of a path, ended."""

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
    """The end of a run to which the controller itself reacts, not only the program that waits for it.

    Attributes:
        outcome: how the run ended.
        sentence: why, for the event log.
    """

    outcome: EgmOutcome
    sentence: str


_FEEDBACK_AGE = 0.0045
"""How much older than its datagram a measured position is [s] (reference/egm.md §2.3)."""

_CLOCK_START = 28_800.0
"""What the controller's clock shows at the first cycle: that of one switched on in the morning [s]."""

_LIMIT_ROUNDING = 1e-4  # a reference in rounded degrees may lie this far beyond a limit in rounded radians [rad]

_SHORTEST_QUATERNION = 0.5
"""Length of a quaternion that still is a rotation; the codec brings any that has a direction to 1."""


class EgmClient:
    """The EGM client of one arm, between its RAPID task, its motion and the wire.

    Args:
        arm: the arm that EGM moves.
        options: what kind of controller it belongs to.

    Attributes:
        state: what EGMGetState returns.
        outcome: how the last :meth:`run_joint` or :meth:`correct_path` ended; None before the first.
        fault: why the session ended by itself, a sentence for the event log; empty when it did not.
        rapid: RAPID's execution state in the datagrams.
        ignored_datagrams: how many datagrams of the sensor could not be decoded, or were rejected.
        offset: beside the path, along the axes of the path, as the sensor wants it [m], (3,).
        is_path_awaited: whether an instruction waits for the path that is corrected, and handles a missing sensor.
    """

    def __init__(self, arm: VirtualArm, options: EgmOptions | None = None) -> None:
        self.state = EgmClientState.DISCONNECTED
        self.outcome: EgmOutcome | None = None
        self.fault = ""
        self.rapid = RapidState.RUNNING
        self.ignored_datagrams = 0
        self.offset = np.zeros(3)
        self.is_path_awaited = False
        self._arm = arm
        self._options = options or EgmOptions()
        self._cycles = 0
        self._failure: EgmFailure | None = None
        self._codec = RobotCodec(axes=arm.kinematics.joint_count)
        limits = arm.model.limits
        self._bounds = replace(
            limits,
            lower=tuple(value - _LIMIT_ROUNDING for value in limits.lower),
            upper=tuple(value + _LIMIT_ROUNDING for value in limits.upper),
        )
        self._session: _EgmSession | None = None
        self._comm_timeout = 1.0
        self._signals: Callable[[], PartialJoints] | None = None
        self._data = ExternalMotionData()
        self._activation = EgmActivation(cond_min_max=DEFAULT_BANDS[: arm.kinematics.joint_count])
        self._run = EgmRun()
        self._goal: Pose | None = None
        self._passage: Passage | None = None  # the last that is corrected

    # What RAPID does

    def get_id(self) -> None:
        """EGMGetId: reserve the identity; nothing happens when it is reserved."""
        self.state = max(self.state, EgmClientState.CONNECTED)

    def setup(
        self,
        comm_timeout: float = 1.0,
        ext_config: ExternalMotionData | None = None,
        signals: Callable[[], PartialJoints] | None = None,
    ) -> None:
        """EGMSetupUC and its like for joint motion.

        Args:
            comm_timeout: longest time without a datagram of the sensor [s].
            ext_config: the system parameters.
            signals: reads the references [rad], (7,), from I/O signals (EGMSetupAI); without it they are datagrams.

        Raises:
            RobotNotReady: there is no identity yet, or EGM runs.
        """
        self._check_state(EgmClientState.CONNECTED)
        self._comm_timeout = comm_timeout
        self._data = ext_config or ExternalMotionData()
        self._signals = signals

    def activate(self, activation: EgmActivation) -> None:
        """EGMActJoint: the settings of the runs that follow; a position stream goes on, with the new tool.

        Raises:
            RobotNotReady: there is no identity yet, or EGM moves the arm.
        """
        if not self.is_streaming:
            self._check_state(EgmClientState.CONNECTED)
        self._activation = activation

    def run_joint(self, run: EgmRun) -> None:
        """EGMRunJoint: begin a session; :attr:`outcome` shows how it ends. Without any axis nothing begins.

        The arm may still be decelerating when the outcome is there: wait for its ``is_stationary``.

        Raises:
            RobotNotReady: there is no identity yet, EGM runs already, or the motors are off.
        """
        self.stream_stop()  # a stream ends where a run begins
        self._check_state(EgmClientState.CONNECTED)
        self.fault = ""
        if not any(run.axes):
            self.outcome = EgmOutcome.CONVERGED
            return
        self._goal = None
        self._arm.start_egm(EgmMotionParameters.of(self._data, self._activation, run))
        self._run = run
        self.outcome = EgmOutcome.RUNNING
        self._begin(self._activation.sample_rate_ms, _EgmUse.GUIDANCE)

    def expect_path(self) -> None:
        """EGMMoveL, EGMMoveC: a leg that the sensor corrects will follow; without a session nothing is corrected yet.

        Raises:
            RobotNotReady: there is no identity yet, or EGM moves the arm.
        """
        if not self.has_path:
            if not self.is_streaming:
                self._check_state(EgmClientState.CONNECTED)
            self.offset, self.outcome = np.zeros(3), None

    def correct_path(self, passage: Passage) -> None:
        """The sensor corrects a leg of the path: a session begins, or the one of the leg before it goes on.

        Args:
            passage: the leg, which the arm follows; the session ends with the last one.

        Raises:
            RobotNotReady: as :meth:`expect_path`.
        """
        self._passage = passage
        frames = passage.leg.frames
        if frames.robot_holds_tool:  # the poses in the datagrams are those of the tool that is corrected
            self._activation = replace(self._activation, tool=frames.tool, wobj=frames.wobj)
        if self.is_correcting:
            return
        self.stream_stop()
        self._check_state(EgmClientState.CONNECTED)
        self.fault, self.outcome = "", EgmOutcome.RUNNING
        self._begin(self._activation.sample_rate_ms, _EgmUse.PATH_CORRECTION)

    def stop(self, mode: EgmStopMode = EgmStopMode.HOLD, ramp_out_time: float = 1.0) -> None:
        """EGMStop: end the run; with RAMP_DOWN the arm goes back to where it began, in ``ramp_out_time`` [s].

        An arm whose path is corrected goes on along the path: with RAMP_DOWN back on the path, with HOLD beside it.
        """
        if self._run_session() is not None:
            if mode is EgmStopMode.RAMP_DOWN:
                self.offset = np.zeros(3)
            self._finish(EgmOutcome.STOPPED, mode, ramp_out_time)

    def abort(self) -> None:
        """The program stops: EGM's speed goes to zero within the configured ramp time, the session ends.

        Run again with :meth:`run_joint` when the program goes on.
        """
        if self._run_session() is not None:
            self._arm.stop_egm(self._data.ramp_time)
            self._end(EgmOutcome.ABORTED if self._arm.motors_on else EgmOutcome.MOTORS_OFF, MciState.STOPPED)
        self.stream_stop()

    def stream_start(self, sample_rate_ms: int = 4) -> None:
        """EGMStreamStart: send positions; replies are not used.

        Raises:
            RobotNotReady: there is no identity yet, or EGM runs.
        """
        self._check_state(EgmClientState.CONNECTED)
        self._begin(sample_rate_ms, _EgmUse.STREAM)

    def stream_stop(self) -> None:
        """EGMStreamStop: end a position stream; a run goes on."""
        if self._session is not None and self.is_streaming:
            self._session.end(MciState.STOPPED)
            self.state = EgmClientState.CONNECTED

    def reset(self) -> None:
        """EGMReset: end whatever runs and give the identity back."""
        self.stop()
        self.stream_stop()
        self.state = EgmClientState.DISCONNECTED

    def power_down(self) -> None:
        """The controller restarts: the session ends without a last datagram, the identity is lost."""
        self.abort()
        self._session = None
        self.state = EgmClientState.DISCONNECTED

    def lose_sensor(self) -> None:
        """End the run as after CommTimeout without a datagram; nothing happens without a run."""
        session = self._run_session()
        if session is not None:
            session.silence = inf

    def converge(self) -> None:
        """End the run as if the convergence criteria were met; nothing happens without a run."""
        if self._run_session() is not None:
            self._finish(EgmOutcome.CONVERGED, self._run.stop_mode, self._run.ramp_out_time)

    def overload(self) -> None:
        """End the run as if the reference asked too much of a drive; nothing happens without a run."""
        if self._run_session() is not None:
            name = self._arm.joint_name(1)
            self._shut_down(EgmOutcome.OVERLOADED, f"The EGM reference needs more than the drive of {name} gives.")

    @property
    def is_running(self) -> bool:
        """Whether EGM moves the arm."""
        return self._run_session() is not None

    @property
    def is_streaming(self) -> bool:
        """Whether a position stream is going on."""
        return self._uses(_EgmUse.STREAM)

    @property
    def is_correcting(self) -> bool:
        """Whether the sensor corrects the path of the program."""
        return self._uses(_EgmUse.PATH_CORRECTION)

    @property
    def has_path(self) -> bool:
        """Whether a leg that the sensor corrects is ahead, also while the program is stopped."""
        goes_on = self.outcome in (EgmOutcome.RUNNING, EgmOutcome.ABORTED, EgmOutcome.MOTORS_OFF)
        return goes_on and self._passage is not None and not self._arm.path.has_ended(self._passage)

    @property
    def resumes(self) -> bool:
        """Whether the run is going on, or will when the program that was interrupted does."""
        survives = (EgmOutcome.RUNNING, EgmOutcome.ABORTED)
        return self.outcome in survives or self._data.restarts_after_motors_off

    def take_failure(self) -> EgmFailure | None:
        """The failure the controller reacts to, once."""
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
        if self._signals is not None:  # no network takes part
            if session.is_over:
                self._session = None
            else:
                session.note_sensor()
                self._follow(session, self._signals(), None)
            return None
        datagram = self._datagram(session)
        if session.is_over:
            self._session = None
        else:
            self._accept_newest(session)
        return datagram

    def _uses(self, use: _EgmUse) -> bool:
        return self._session is not None and self._session.use is use and not self._session.is_over

    def _run_session(self) -> _EgmSession | None:
        """The session of which the sensor moves the arm."""
        session = self._session
        return session if session is not None and session.use is not _EgmUse.STREAM and not session.is_over else None

    def _check_state(self, needed: EgmClientState) -> None:
        if self.state is not needed:
            raise RobotNotReady(
                f"EGM of the {self._arm.kinematics.name} is {self.state.name.lower()}: "
                f"it has to be {needed.name.lower()} for this."
            )

    def _begin(self, sample_rate_ms: int, use: _EgmUse) -> None:
        self._session = _EgmSession(
            use,
            cycles_per_datagram=max(1, sample_rate_ms // 4),
            mci=MciState.STOPPED if use is _EgmUse.STREAM else MciState.RUNNING,
        )
        self.state = EgmClientState.RUNNING

    def _finish(self, outcome: EgmOutcome, mode: EgmStopMode, ramp_out_time: float) -> None:
        """End the run as its stop mode says; with HOLD the ramp means nothing (reference/egm.md §4.6)."""
        returns = mode is EgmStopMode.RAMP_DOWN
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
        self.state = EgmClientState.CONNECTED

    def _supervise(self, session: _EgmSession) -> None:
        """End a run that ends without an instruction."""
        egm, corrects = self._arm.egm, session.use is _EgmUse.PATH_CORRECTION
        if session.use is _EgmUse.STREAM or session.is_over:
            return
        if (egm is None and not corrects) or not self._arm.motors_on:
            self.fault = f"The {self._arm.kinematics.name} was stopped while EGM was running."
            self.abort()
        elif session.silence > self._comm_timeout:
            sentence = f"No datagram has come for {self._comm_timeout:g} s."
            self._fail(EgmOutcome.COMM_TIMEOUT, sentence, self._data.ramp_time)
            if not (self.is_path_awaited if corrects else self._run.is_waited):
                self._failure = EgmFailure(EgmOutcome.COMM_TIMEOUT, sentence)
        elif egm is None:
            if self._passage is None or self._arm.path.has_ended(self._passage):
                self.offset = np.zeros(3)
                self._end(EgmOutcome.STOPPED, MciState.STOPPED)
        elif self._arm.overload is not None:
            overload = self._arm.overload
            name = self._arm.joint_name(overload.joint)
            self._shut_down(
                EgmOutcome.OVERLOADED,
                f"The EGM reference needs {overload.torque:.0f} N m at {name}, whose drive gives "
                f"{overload.limit:.0f} N m: limit the acceleration of the reference.",
            )
        elif self._bounds.outside(self._arm.planned) is not None:
            self._leave_bounds(self._arm.planned)
        else:
            self._check_convergence(session, egm.reference)

    def _check_convergence(self, session: _EgmSession, reference: Joints) -> None:
        run, bands = self._run, self._activation.cond_min_max
        axes = zip(self._deviations(reference), bands, run.axes, strict=True)
        is_in_band = all(low <= deviation <= high for deviation, (low, high), is_selected in axes if is_selected)
        # The time in the bands begins with the first datagram of the sensor.
        counts = is_in_band and session.has_sensor
        session.time_in_band = session.time_in_band + self._options.cycle_time if counts else 0.0
        session.is_in_band = is_in_band
        if counts and session.time_in_band >= run.cond_time:
            self._finish(EgmOutcome.CONVERGED, run.stop_mode, run.ramp_out_time)

    def _accept_newest(self, session: _EgmSession) -> None:
        datagram, session.newest = session.newest, None
        if datagram is None:
            return
        try:
            if session.use is _EgmUse.PATH_CORRECTION:
                self._correct(session, self._codec.decode_correction(datagram).offset)
                return
            message = self._codec.decode(datagram)
        except ProtocolError:
            self.ignored_datagrams += 1
            return
        rejects = self._options.invalid_reference is InvalidEgmReference.REJECT
        if rejects and not _is_finite(message.position, message.velocity):
            self.ignored_datagrams += 1
            return
        session.note_sensor()
        if self._activation.frame is None:
            self._follow(session, message.position, message.velocity)
        elif message.tool_position is not None:
            self._follow_pose(session, message.tool_position, message.tool_orientation)

    def _correct(self, session: _EgmSession, offset: Vector) -> None:
        """Let the path be corrected across its direction; what is along it is not used (reference/egm.md §2.5)."""
        if all(map(isfinite, offset)):
            session.note_sensor()
            self.offset = np.array((0.0, *offset[1:]))
        elif self._options.invalid_reference is InvalidEgmReference.REJECT:
            self.ignored_datagrams += 1
        else:
            sentence = f"The {self._arm.kinematics.name} got a path correction that is not of finite numbers."
            self._shut_down(EgmOutcome.SYSTEM_FAILURE, sentence)

    def _follow_pose(self, session: _EgmSession, point: Vector, orientation: Quaternion | None) -> None:
        """Let the arm follow a pose of the tool in the sensor's frame; without an orientation it keeps its own."""
        egm, activation = self._arm.egm, self._activation
        if egm is None or session.use is not _EgmUse.GUIDANCE or activation.frame is None:
            return
        if not all(map(isfinite, (*point, *(orientation or ())))):
            self._shut_down(EgmOutcome.SYSTEM_FAILURE, "EGM got a pose that is not of finite numbers.")
            return
        # It is no rotation, nor to be made one.
        if orientation is not None and hypot(*orientation) < _SHORTEST_QUATERNION:
            self._shut_down(EgmOutcome.SYSTEM_FAILURE, "EGM got a pose whose quaternion has no direction.")
            return
        own = compose_poses(inverse_pose(activation.frame), self._arm.tool_pose(egm.reference, activation.tool))
        self._goal = goal = Pose(point, orientation or own.orientation)
        tool0 = compose_poses(activation.frame, goal)
        if activation.tool is not None:
            tool0 = compose_poses(tool0, inverse_pose(activation.tool))
        kinematics = self._arm.kinematics
        angle = float(kinematics.angles(np.array([egm.reference]))[0])
        at, turned = np.array([tool0.position]), matrix_from_quaternion(tool0.orientation)[None]
        reference = kinematics.reached(at, turned, angle, egm.reference)
        if reference is None:
            where = ", ".join(f"{value * 1e3:.0f}" for value in point)
            sentence = f"External Motion Interface input out of bounds: no posture near has the tool at [{where}] mm."
            self._shut_down(EgmOutcome.OUT_OF_BOUNDS, sentence)
        else:
            self._arm.set_reference(reference, None)

    def _deviations(self, reference: Joints) -> tuple[float, ...]:
        """What the convergence bands are for: of the joints [rad], or of the tool's pose [m], [rad]."""
        if self._activation.frame is None or self._goal is None:
            return tuple(measured - goal for goal, measured in zip(reference, self._arm.position, strict=True))
        tool = self._arm.tool_pose(self._arm.position, self._activation.tool)
        own = compose_poses(inverse_pose(self._activation.frame), tool)
        way = (a - b for a, b in zip(own.position, self._goal.position, strict=True))
        turn = matrix_from_quaternion(self._goal.orientation).T @ matrix_from_quaternion(own.orientation)
        return (*way, *rotation_vectors(turn[None])[0].tolist())

    def _follow(self, session: _EgmSession, position: PartialJoints | None, velocity: PartialJoints | None) -> None:
        """Let the arm follow references [rad], [rad/s], unless they are out of bounds."""
        egm = self._arm.egm
        if egm is None or session.use is not _EgmUse.GUIDANCE:
            return
        goal = None if position is None else _completed(position, egm.reference)
        speed = None if velocity is None else _completed(velocity, (0.0,) * len(egm.reference))
        if not _is_finite(goal, speed):
            self._shut_down(
                EgmOutcome.SYSTEM_FAILURE,
                f"The {self._arm.kinematics.name} got an EGM reference that is not a finite number.",
            )
        elif goal is not None and self._run.pos_corr_gain > 0.0 and self._bounds.outside(goal) is not None:
            self._leave_bounds(goal)
        else:
            self._arm.set_reference(goal, speed)

    def _leave_bounds(self, position: Joints) -> None:
        index = self._bounds.outside(position) or 0
        name, range_deg = self._arm.joint_name(index), self._arm.model.limits.range_deg(index)
        at_deg = degrees(position[index])
        sentence = f"External Motion Interface input out of bounds: {name} at {at_deg:.1f}°, range {range_deg}."
        self._shut_down(EgmOutcome.OUT_OF_BOUNDS, sentence)

    def _shut_down(self, outcome: EgmOutcome, sentence: str) -> None:
        """A failure on which the real controller switches its motors off (reference/egm.md §4.5)."""
        self._fail(outcome, sentence)
        self._arm.switch_motors_off()
        self._failure = EgmFailure(outcome, sentence)

    def _datagram(self, session: _EgmSession) -> bytes:
        """The next datagram of the session (reference/egm.md §3)."""
        arm, options = self._arm, self._options
        measured, planned = arm.position, arm.planned
        measured_pose = self._tool_pose(measured)
        now = _CLOCK_START + self._cycles * options.cycle_time
        measured_time = now - _FEEDBACK_AGE
        utilization = 0.0 if arm.egm is None else arm.egm.utilization
        seqno = session.seqno
        session.seqno += 1
        message = RobotMessage(
            seqno=seqno,
            sent_ms=int(now * 1000.0) % 2**32,
            measured=measured,
            planned=planned,
            measured_pose=measured_pose,
            planned_pose=measured_pose if planned == measured else self._tool_pose(planned),
            measured_time=measured_time,
            planned_time=measured_time + arm.reaction_time,
            motors=MotorState.ON if arm.motors_on else MotorState.OFF,
            mci=session.mci,
            rapid=self.rapid if options.sends_rapid_state else RapidState.UNDEFINED,
            is_converged=session.is_in_band,
            utilization=utilization if options.robotware is EgmRobotWare.RW_6_10 else None,
        )
        return self._codec.encode(message)

    def _tool_pose(self, position: Joints) -> Pose:
        pose = self._arm.tool_pose(position, self._activation.tool)
        wobj = self._activation.wobj
        return pose if wobj is None else compose_poses(inverse_pose(wobj), pose)


def _completed(values: PartialJoints, last: Joints) -> Joints:
    """Axes that the sensor leaves out keep their last value (reference/egm.md §10 item 18)."""
    return tuple(old if new is None else new for new, old in zip(values, last, strict=True))


def _is_finite(*parts: PartialJoints | None) -> bool:
    return all(isfinite(value) for part in parts for value in part or () if value is not None)
