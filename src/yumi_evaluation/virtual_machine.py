"""Robot Web Services without sockets: requests go straight to the virtual controller, its messages straight back.

How closely the virtual arm follows a trajectory that is known in advance: a sine on one joint, in virtual time.

The arm whose control lag was fitted to the published step times, and to nothing else.

``benchmarks/tracking/fit_model.py`` does it again (:mod:`yumi_evaluation.lag_study`).

Experiments in virtual time: a virtual arm, the wire's codecs, our fast line with its controllers; always the same.

Bare, nothing but the gain's range and the guard's limits differ from what is shipped: a gain may be as high as one
likes, and the guard lets every step pass, as the publication's system did.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import cos, degrees, pi, radians, sin
from threading import RLock

from yumi.clock import Clock
from yumi.control.commands import MemoryBuffer, SessionGoal, write_goal
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.controllers.joint_trajectory import FollowTrajectory, JointTrajectoryController
from yumi.control.limiter import Guard
from yumi.control.trajectory import JointTrajectory, TrajectoryPoint, plan_trajectory
from yumi.errors import ControllerRefused
from yumi.robot.joints import CYCLE, JOINT_COUNT, YUMI_LIMITS, JointLimits, Joints, Side, joint_names, joints
from yumi.rws.client import DEFAULT_PASSWORD, DEFAULT_USER
from yumi.rws.http import ConnectionLost, HttpReply, HttpRequest, Listener
from yumi.settings import Parameter, Values
from yumi.virtual.mechanics.arm import ArmModel
from yumi.virtual.rws.adapter import RwsAdapter
from yumi.virtual.rws.http_server import Upgrade
from yumi.virtual.rws.routes import Controller
from yumi_evaluation.experiment import CONTROLLER as EXPERIMENT_CONTROLLER
from yumi_evaluation.experiment import GOAL_RATE, Experiment, Mode, System, Trace
from yumi_evaluation.experiment import Sine as ExperimentSine
from yumi_evaluation.guided_arm import GuidedArm


class MemoryChannel:
    """The controller's end of a WebSocket."""

    def __init__(self, listener: Listener) -> None:
        self.is_open = True
        self.has_left = False
        self._listener = listener

    def send(self, text: str) -> None:
        if self.is_open:
            self._listener.on_text(text)

    def abort(self) -> None:
        if self.is_open:
            self.is_open = False
            self._listener.on_lost("The WebSocket of memory broke.")

    def close(self) -> None:
        """The controller's end goes in order."""
        self.abort()


class MemorySocket:
    """The client's end."""

    def __init__(self, channel: MemoryChannel) -> None:
        self._channel = channel

    def close(self) -> None:
        self._channel.has_left = self._channel.is_open
        self._channel.is_open = False


class MemoryRws:
    """A link to ``controller``; call ``advance`` whenever time has passed.

    Args:
        controller: the virtual one.
        clock: of both ends.

    Attributes:
        adapter: the controller's end of it.
    """

    address = "memory"

    def __init__(self, controller: Controller, clock: Clock) -> None:
        self.adapter = RwsAdapter(controller, user=DEFAULT_USER, password=DEFAULT_PASSWORD, hang_up=self.hang_up)
        self._clock = clock
        self._channels: list[MemoryChannel] = []
        self._lock = RLock()  # the driver's threads ask side by side, a controller answers one after another

    def advance(self) -> None:
        """The controller tells what has changed."""
        with self._lock:
            self.adapter.advance(self._clock.now())

    def exchange(self, request: HttpRequest, timeout: float) -> HttpReply:
        """The answer, at once; raises ConnectionLost when there is none."""
        reply = self.handle(request)
        if not isinstance(reply, HttpReply):
            raise ConnectionLost("memory closed the connection without an HTTP answer.")
        return reply

    def open_socket(self, request: HttpRequest, listener: Listener, timeout: float) -> MemorySocket:
        """A WebSocket; raises ControllerRefused when the controller opens none."""
        headers = (*request.headers, ("Upgrade", "websocket"), ("Sec-WebSocket-Protocol", listener.protocol))
        reply = self.handle(HttpRequest("GET", request.target, headers, peer="socket"))
        if not isinstance(reply, Upgrade):
            raise ControllerRefused("memory does not open a WebSocket.", status=reply.status if reply else 0)
        channel = MemoryChannel(listener)
        self._channels.append(channel)
        reply.attach(channel)
        return MemorySocket(channel)

    def handle(self, request: HttpRequest) -> HttpReply | Upgrade | None:
        """What the controller makes of a request; None closes the connection."""
        with self._lock:
            return self.adapter.handle(request, self._clock.now())

    def hang_up(self) -> None:
        """The controller breaks all WebSockets."""
        for channel in self._channels:
            channel.abort()

    def close(self) -> None:
        """Nothing to close."""


CONTROLLER = "joint_trajectory_controller"
SIDE = Side.LEFT

_JOINT = 6  # of the chain: axis 6
_REST = (0.0,) * JOINT_COUNT
_SPACING = 0.1  # [s] between two points


@dataclass(frozen=True, slots=True)
class Sine:
    """A sine that begins, and ends, where it turns.

    Attributes:
        amplitude: [rad].
        frequency: [Hz].
        periods: how many.
    """

    amplitude: float
    frequency: float = 0.2
    periods: int = 2

    @property
    def duration(self) -> float:
        """[s]."""
        return self.periods / self.frequency

    def at(self, time: float) -> tuple[float, float, float]:
        """Distance from its begin [rad], velocity [rad/s] and acceleration [rad/s²]."""
        turn = 2.0 * pi * self.frequency
        angle = turn * max(0.0, min(self.duration, time))
        size = self.amplitude
        return size * (1.0 - cos(angle)), size * turn * sin(angle), size * turn * turn * cos(angle)

    def points(self, start: Joints, joint: int) -> tuple[TrajectoryPoint, ...]:
        """As points with positions, velocities and accelerations of one joint, from ``start`` [rad]."""
        times = [number * _SPACING for number in range(round(self.duration / _SPACING) + 1)]
        rows = [(time, self.at(time)) for time in times]
        moving = [
            TrajectoryPoint(
                time,
                _with(start, start[joint] + way, joint),
                _with(_REST, speed, joint),
                _with(_REST, gain, joint),
            )
            for time, (way, speed, gain) in rows
        ]
        return (*moving[:-1], moving[-1]._replace(velocity=_REST))


@dataclass(frozen=True, slots=True)
class Tracking:
    """How an arm followed.

    Attributes:
        max_error_deg: largest difference of the measured from the planned position [°].
        mean_lag: by how much it was late on average, in the sense of least squares [s].
        slowed: cycles in which the guard changed the command.
        sentence: how the motion ended.
    """

    max_error_deg: float
    mean_lag: float
    slowed: int
    sentence: str


@dataclass(frozen=True, slots=True)
class Way:
    """The way an arm went.

    Attributes:
        measured: time since the trajectory began [s], angle from where it began [rad].
        slowed: cycles in which the guard changed the command.
        sentence: how the motion ended.
    """

    measured: tuple[tuple[float, float], ...]
    slowed: int
    sentence: str


def follow_sine(sine: Sine, parameters: Values | None = None) -> Tracking:
    """Have the virtual arm follow ``sine`` on axis 6 at full-speed settings, with the controller's ``parameters``."""
    way = follow_planned(sine, parameters)
    errors = [angle - sine.at(time)[0] for time, angle in way.measured]
    speeds = [sine.at(time)[1] for time, _ in way.measured]
    lag = -sum(error * speed for error, speed in zip(errors, speeds, strict=True)) / sum(
        [speed * speed for speed in speeds]
    )
    return Tracking(degrees(max(map(abs, errors))), lag, way.slowed, way.sentence)


def follow_planned(sine: Sine, parameters: Values | None = None, *, side: Side = SIDE, joint: int = _JOINT) -> Way:
    """Have one joint of a virtual arm follow ``sine`` as a trajectory; see :func:`follow_sine`."""
    controller = JointTrajectoryController(side, MemoryBuffer())
    arm = GuidedArm({CONTROLLER: controller}, side=side)
    arm.manager.set_parameters(CONTROLLER, parameters or {})
    arm.start()
    arm.switch_to(CONTROLLER)
    arm.run(0.1)
    state = arm.line.state
    assert state is not None
    start, begin, slowed = state.planned, state.time + 0.1, arm.snapshot.slowed
    trajectory = JointTrajectory(joint_names(side), sine.points(start, joint), start=begin)
    plan = plan_trajectory(trajectory, (side,), YUMI_LIMITS)[side]
    arm.manager.receive(CONTROLLER, FollowTrajectory(plan, goal=1), state)
    first = len(arm.cycles)
    arm.run(sine.duration + 0.5)
    states = [cycle.state for cycle in arm.cycles[first:]]
    measured = tuple((each.time - begin, each.position[joint] - start[joint]) for each in states)
    return Way(measured, arm.snapshot.slowed - slowed, str(arm.events[-1]))


def _with(values: tuple[float, ...], value: float, joint: int) -> tuple[float, ...]:
    return (*values[:joint], value, *values[joint + 1 :])


CONTROL_LAG = 0.0167
"""From reference to position, where our step times are closest to the published ones [s]."""


def arm_with(control_lag: float) -> ArmModel:
    """An arm with that control lag [s], shared between delay and servo lag as in the virtual robot that is shipped."""
    shipped = ArmModel()
    share = shipped.delay / (shipped.delay + shipped.lag)
    return ArmModel(delay=share * control_lag, lag=(1.0 - share) * control_lag)


FITTED = arm_with(CONTROL_LAG)


HIGHEST_GAIN = 10.0
"""To which a sweep may go; what is shipped refuses more than 2."""

_VIRTUAL_EXPERIMENT_REST = 0.2  # [s] until the robot has taken over
_NO_LIMIT = joints([1e9] * JOINT_COUNT)


class AnyGainController(JointPositionController):
    """The joint position controller for which no gain is too high: to find where oscillation begins."""

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        own = super().parameters(joint_names)
        return tuple(replace(each, highest=HIGHEST_GAIN) if each.name == "p" else each for each in own)


def run_virtually(experiment: Experiment, system: System = System.SHIPPED, model: ArmModel | None = None) -> Trace:
    """Run ``experiment`` in virtual time.

    Args:
        experiment: what is asked.
        system: with our guard, or without, as published.
        model: of the arm; what is shipped, or when bare the fitted one, if left out.
    """
    if experiment.law.is_planned:
        return _run_planned(experiment)
    model = model or (FITTED if system is System.BARE else ArmModel())
    goals, limits = MemoryBuffer[SessionGoal](), _limits(experiment.mode)
    guard = Guard(limits if system is System.SHIPPED else _unlimited(limits))
    controller = AnyGainController(goals, limits)
    arm = GuidedArm({EXPERIMENT_CONTROLLER: controller}, side=experiment.side, guard=guard, model=model)
    arm.manager.set_parameters(EXPERIMENT_CONTROLLER, experiment.law.values)
    arm.start(experiment.mode.value)
    arm.run(_VIRTUAL_EXPERIMENT_REST)
    arm.switch_to(EXPERIMENT_CONTROLLER)
    return _follow(experiment, arm, goals)


def goal_times(experiment: Experiment) -> Iterator[float]:
    """When goals are sent, from the beginning [s]: once for a step, at 500 Hz for a sine."""
    count = 1 if experiment.is_step else int(experiment.duration * GOAL_RATE)
    return iter([number / GOAL_RATE for number in range(count)])


def planned_sine(sine: ExperimentSine) -> Sine:
    """The same as a trajectory: it begins, and ends, where it turns."""
    return Sine(sine.amplitude, sine.frequency, periods=1)


def planned_goals(sine: Sine) -> list[tuple[float, float]]:
    """Where the joint shall be, at the rate of goals that are streamed: time [s], angle [rad]."""
    times = [number / GOAL_RATE for number in range(int(sine.duration * GOAL_RATE))]
    return [(time, sine.at(time)[0]) for time in times]


def moved(start: Joints, way: float, which: tuple[int, ...]) -> Joints:
    """``start`` with the joints ``which`` moved by ``way`` [rad]."""
    return joints([value + way * (index in which) for index, value in enumerate(start)])


def _follow(experiment: Experiment, arm: GuidedArm, goals: MemoryBuffer[SessionGoal]) -> Trace:
    reference, which = experiment.reference, experiment.moved
    start, begin, slowed, first = arm.robot.arm.planned, arm.clock.now(), arm.snapshot.slowed, len(arm.cycles)
    times, session = list(goal_times(experiment)), arm.snapshot.session
    coming = iter([*times, float("inf")])
    due = next(coming)
    while arm.clock.now() - begin < experiment.duration:
        # What is sent before a datagram arrives is there when it is answered.
        while begin + due <= arm.clock.now() + CYCLE:
            write_goal(goals, session, moved(start, reference(due), which), time=begin + due)
            due = next(coming)
        arm.cycle()
    states = [cycle.state for cycle in arm.cycles[first:]]
    measured = {
        joint: [(state.time - begin, state.position[joint] - start[joint]) for state in states] for joint in which
    }
    return Trace(experiment, [(time, reference(time)) for time in times], measured, arm.snapshot.slowed - slowed)


def _run_planned(experiment: Experiment) -> Trace:
    """A trajectory: the sine begins where it turns, since a planned motion begins at rest."""
    reference, (joint, *_) = experiment.reference, experiment.moved
    assert isinstance(reference, ExperimentSine), "trajectories are measured with sines"
    sine = planned_sine(reference)
    way = follow_planned(sine, side=experiment.side, joint=joint)
    return Trace(experiment, planned_goals(sine), {joint: way.measured}, way.slowed)


def _limits(mode: Mode) -> JointLimits:
    return YUMI_LIMITS.slowed_to(radians(mode.value.max_speed_deviation))


def _unlimited(limits: JointLimits) -> JointLimits:
    """Only the ranges remain."""
    return replace(limits, velocity=_NO_LIMIT, acceleration=_NO_LIMIT, jerk=_NO_LIMIT)
