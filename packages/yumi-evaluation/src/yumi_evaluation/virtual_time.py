"""Virtual time: both ends of one arm's EGM with our control loop, and experiments with them; deterministic.

The rig is a virtual arm, a link that may be tampered with, the wire's codecs and our control loop. It has no RAPID and
no RWS, so that it is fast: what a controller, the limiter, the link and the robot's motion make of a reference is
there, and nothing else.

In experiments that are bare, nothing but the gain's range and the limiter's limits differ from what is shipped: a gain
may be as high as one likes, and the limiter lets every step pass, as the thesis's system did.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import cos, inf, pi, radians, sin

from abb_protocols.robot.joints import CYCLE, JOINT_COUNT, YUMI_LIMITS, JointLimits, Joints, Side, joint_names, joints
from abb_runtime.clock import ManualClock
from abb_runtime.parameters import Parameter, Values
from abb_runtime.udp import memory_links
from virtual_irc5.mechanics.arm import VirtualArm
from virtual_irc5.mechanics.arm_motion import ArmModel
from virtual_irc5.mechanics.egm_client import EgmClient, EgmOptions
from virtual_irc5.mechanics.egm_motion import EgmActivation, EgmRun, ExternalMotionData
from yumi.control.controller import Controller
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.controllers.joint_trajectory import JointTrajectoryController
from yumi.control.cycle import Cycle
from yumi.control.goals import MemoryBuffer, SessionGoal, write_goal
from yumi.control.limiter import Limiter
from yumi.control.loop import ArmLoop
from yumi.control.loop_events import Event
from yumi.control.manager.controller_manager import ControllerManager
from yumi.control.motion.spline import TrajectoryPoint
from yumi.control.shared_state import SharedDeadline, Snapshot, read_snapshot
from yumi.control.speed_scale import SpeedScale
from yumi.control.trajectory_commands import FollowTrajectory
from yumi.driver.egm_arm import EgmArm
from yumi.driver.state_machine import EgmMotionSettings
from yumi.egm.egm_session import ROBOT_SILENCE, Session
from yumi.planning.trajectory_request import JointTrajectory, plan_trajectory
from yumi_evaluation.experiments import AXIS_6, GOAL_RATE, Experiment, Mode, Sine, Step, System, Trace
from yumi_evaluation.metrics import Series, series

FULL_SPEED = EgmMotionSettings()
"""The thesis's table 4.3: 180 deg/s, no filter, raw."""

Wire = Callable[[bytes], Sequence[bytes]]
"""What becomes of a datagram on its way: itself, nothing, several, another one."""


class VirtualArmEnd:
    """The robot's end: one arm with its EGM client and what the state machine does to it.

    Args:
        side: which arm.
        model: its dynamics.
        options: what kind of controller it belongs to.
        position: where it stands at first [rad], (7,); home when left out.
    """

    def __init__(
        self,
        side: Side,
        model: ArmModel | None = None,
        options: EgmOptions | None = None,
        position: Joints | None = None,
    ) -> None:
        self.arm = VirtualArm(side, position, model)
        self.arm.switch_motors_on()
        self.egm = EgmClient(self.arm, options)

    def start(self, motion: EgmMotionSettings) -> None:
        """A session with ``motion``; one that is going on ends."""
        activation = EgmActivation(lp_filter=motion.lp_filter, max_speed_deviation=radians(motion.max_speed_deviation))
        self.egm.reset()
        self.egm.get_id()
        self.egm.setup(motion.comm_timeout, ExternalMotionData(level=int(motion.use_filtering), ramp_time=2.0))
        self.egm.activate(activation)
        self.egm.run_joint(
            EgmRun(cond_time=motion.cond_time, ramp_in_time=motion.ramp_in_time, pos_corr_gain=motion.pos_corr_gain)
        )

    def cycle(self, inbox: Sequence[bytes]) -> bytes | None:
        datagram = self.egm.cycle(inbox)
        self.arm.advance(CYCLE)
        return datagram


class VirtualArmRig:
    """A virtual arm and our control loop with some controllers; a reply arrives one cycle after its datagram.

    Args:
        controllers: by name; all are configured and none is active.
        side: which arm.
        limiter: of the control loop; one with the limits of the YuMi when left out.
        model: dynamics of the virtual arm.
        position: where it stands at first [rad], (7,); home when left out.
        speed: the factor on its speeds, which its controllers share.
        silence: EGM has ended for our end after this time without a datagram [s].

    Attributes:
        robot: the robot's end.
        manager: the controllers.
        clock: the time of everything.
        cycles: what our end did, cycle by cycle.
        events: what it reported.
        deadline: until when the one who commands the arm must be heard again.
        to_us, to_robot: the two directions of the link; a test may replace them.
    """

    def __init__(
        self,
        controllers: Mapping[str, Controller],
        *,
        side: Side = Side.LEFT,
        limiter: Limiter | None = None,
        model: ArmModel | None = None,
        position: Joints | None = None,
        speed: SpeedScale | None = None,
        silence: float = ROBOT_SILENCE,
    ) -> None:
        self.robot = VirtualArmEnd(side, model, position=position)
        self.clock = ManualClock(100.0)
        self.manager = ControllerManager(joint_names(side))
        self.cycles: list[Cycle] = []
        self.events: list[Event] = []
        self.to_us: Wire = lambda datagram: (datagram,)
        self.to_robot: Wire = lambda datagram: (datagram,)
        self._snapshots = MemoryBuffer[Snapshot]()
        for name, controller in controllers.items():
            self.manager.load(name, controller)
            self.manager.configure(name)
        self._near, self._far = memory_links()
        limiter = limiter or Limiter(YUMI_LIMITS)
        arm = EgmArm(self._near, Session(silence), limiter)
        self.deadline = MemoryBuffer[SharedDeadline]()
        self.line = ArmLoop(side, arm, self.manager, limiter, self._snapshots, speed=speed, deadline=self.deadline)

    @property
    def snapshot(self) -> Snapshot:
        return read_snapshot(self._snapshots)

    def start(self, motion: EgmMotionSettings = FULL_SPEED) -> None:
        """Start EGM and wait until the robot follows."""
        self.robot.start(motion)
        self.run_until(lambda: self.snapshot.is_running, limit=1.0)

    def switch_to(self, name: str) -> None:
        """Let controller ``name`` command, and no other one."""
        commanding = [info.name for info in self.manager.controllers() if info.claimed]
        self.manager.switch((name,), commanding, self.line.state)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / CYCLE)):
            self.cycle()

    def run_until(self, condition: Callable[[], bool], limit: float) -> None:
        """Let time pass until the condition holds; fails after ``limit`` [s]."""
        for _ in range(round(limit / CYCLE)):
            if condition():
                return
            self.cycle()
        raise AssertionError(f"not within {limit} s: {self.robot.egm.fault}")

    def cycle(self) -> None:
        """One cycle of the robot, then of our end."""
        self.clock.advance(CYCLE)
        replies = [arriving for sent in self._far.receive() for arriving in self.to_robot(sent)]
        datagram = self.robot.cycle(replies)
        for arriving in self.to_us(datagram) if datagram is not None else ():
            self._far.send(arriving)
        while self._near.has_datagram:  # as the driver's poll says
            answered = self.line.run(self.clock.now())
            if answered is not None:
                self.cycles.append(answered)
        self.line.watch_silence(self.clock.now())
        self.events += self.line.take_events()


CONTROLLER = "joint_position_controller"
TRAJECTORY_CONTROLLER = "joint_trajectory_controller"

FITTED_ACCELERATION = 6.0
"""The highest that EGM plans, where our steps are like the published ones [rad/s²].

Fitted to them and to nothing else: between 5 and 8 rad/s² the step times fit alike, and with this one oscillation
begins at the published gain. benchmarks/tracking/fit_model.py does it again.
"""

HIGHEST_GAIN = 10.0
"""To which a sweep may go; the shipped controller refuses more than 2."""

_TAKEOVER = 0.2  # [s] until the robot has taken over
_NO_LIMIT = joints([1e9] * JOINT_COUNT)
_REST = joints([0.0] * JOINT_COUNT)
_SPACING = 0.1  # [s] between two points of a trajectory


def arm_with(acceleration: float) -> ArmModel:
    """The virtual robot that is shipped, whose EGM plans no higher acceleration than that [rad/s²]."""
    return ArmModel(egm_acceleration=joints([acceleration] * JOINT_COUNT))


FITTED = arm_with(FITTED_ACCELERATION)


class AnyGainController(JointPositionController):
    """The joint position controller for which no gain is too high: to find where oscillation begins."""

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        own = super().parameters(joint_names)
        return tuple(replace(each, highest=HIGHEST_GAIN) if each.name == "p" else each for each in own)


def run_virtually(experiment: Experiment, system: System = System.SHIPPED, model: ArmModel | None = None) -> Trace:
    """Run ``experiment`` in virtual time.

    Args:
        experiment: what to run.
        system: BARE runs without the limiter, as published; others with it.
        model: of the arm; by default the fitted one when bare, else the shipped one.
    """
    reference, which = experiment.reference, experiment.moved
    if experiment.controller.is_planned:
        planned = planned_sine(reference)
        path = follow_planned(planned, side=experiment.side, joint=which[0])
        return Trace(experiment, planned.goals(), {which[0]: path.measured}, path.slowed)
    limits = YUMI_LIMITS.slowed_to(radians(experiment.mode.value.max_speed_deviation))
    is_bare = system is System.BARE
    unlimited = replace(limits, velocity=_NO_LIMIT, acceleration=_NO_LIMIT, jerk=_NO_LIMIT)  # only the ranges remain
    rig = StreamedArm(
        limits,
        experiment.controller.values,
        experiment.mode,
        experiment.side,
        Limiter(unlimited if is_bare else limits),
        model or (FITTED if is_bare else ArmModel()),
    )
    times = goal_times(experiment)
    rig.stream(reference, which, [(time, time) for time in times], experiment.duration)
    measured = {joint: rig.measured(joint) for joint in which}
    return Trace(experiment, series([(time, reference(time)) for time in times]), measured, rig.slowed)


def goal_times(experiment: Experiment) -> list[float]:
    """When goals are sent, from the beginning [s]: once for a step, at 500 Hz for a sine."""
    return [number / GOAL_RATE for number in range(1 if experiment.is_step else int(experiment.duration * GOAL_RATE))]


def moved(start: Joints, distance: float, which: Sequence[int]) -> Joints:
    """``start`` with the joints ``which`` moved by ``distance`` [rad]."""
    return joints([value + distance * (index in which) for index, value in enumerate(start)])


class StreamedArm:
    """An arm in virtual time whose joint position controller is active and is sent goals."""

    def __init__(
        self,
        limits: JointLimits,
        values: Values,
        mode: Mode,
        side: Side,
        limiter: Limiter,
        model: ArmModel | None = None,
    ) -> None:
        self._goals = MemoryBuffer[SessionGoal]()
        controller = AnyGainController(self._goals, limits)
        self.rig = VirtualArmRig({CONTROLLER: controller}, side=side, limiter=limiter, model=model)
        self.rig.manager.set_parameters(CONTROLLER, values)
        self.rig.start(mode.value)
        self.rig.run(_TAKEOVER)
        self.rig.switch_to(CONTROLLER)
        self._start, self._begin = self.rig.robot.arm.planned, self.rig.clock.now()
        self._first, self._slowed = len(self.rig.cycles), self.rig.snapshot.limiter.slowed
        self.speeds: list[Joints] = []

    def stream(
        self, reference: Step | Sine, which: Sequence[int], arrivals: Iterable[tuple[float, float]], duration: float
    ) -> None:
        """Send goals for ``duration`` [s]; ``arrivals``: when each arrives and when it was sent, from the begin [s]."""
        rig, coming = self.rig, iter(arrivals)
        arrival, sent = next(coming, (inf, inf))
        while rig.clock.now() - self._begin < duration:
            # What is sent before a datagram arrives is there when it is answered.
            while self._begin + arrival <= rig.clock.now() + CYCLE:
                goal = moved(self._start, reference(sent), which)
                write_goal(self._goals, rig.snapshot.session, goal, time=self._begin + arrival)
                arrival, sent = next(coming, (inf, inf))
            rig.cycle()
            self.speeds.append(rig.robot.arm.velocity)

    def measured(self, joint: int) -> Series:
        """Time since the begin [s] and angle from where the joint began [rad]."""
        states = [cycle.state for cycle in self.rig.cycles[self._first :]]
        return series([(each.time - self._begin, each.position[joint] - self._start[joint]) for each in states])

    @property
    def slowed(self) -> int:
        """Cycles in which the limiter changed the command."""
        return self.rig.snapshot.limiter.slowed - self._slowed


@dataclass(frozen=True, slots=True)
class PlannedSine:
    """A sine as a trajectory: it begins and ends where it turns, since a planned motion begins at rest.

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
        """Points with positions, velocities and accelerations of one joint, from ``start`` [rad]."""
        points, last = [], round(self.duration / _SPACING)
        for number in range(last + 1):
            distance, speed, acceleration = self.at(number * _SPACING)
            velocity = moved(_REST, speed if number < last else 0.0, (joint,))
            position = moved(start, distance, (joint,))
            points.append(TrajectoryPoint(number * _SPACING, position, velocity, moved(_REST, acceleration, (joint,))))
        return tuple(points)

    def goals(self) -> Series:
        """The reference at the rate of goals that are streamed: time [s], angle [rad]."""
        times = [number / GOAL_RATE for number in range(int(self.duration * GOAL_RATE))]
        return series([(time, self.at(time)[0]) for time in times])


def planned_sine(reference: Step | Sine) -> PlannedSine:
    """One period of the same sine as a trajectory."""
    assert isinstance(reference, Sine), "trajectories are measured with sines"
    return PlannedSine(reference.amplitude, reference.frequency, periods=1)


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """How an arm followed a trajectory.

    Attributes:
        measured: time since the trajectory began [s], angle from where it began [rad].
        slowed: cycles in which the limiter changed the command.
        outcome: how the motion ended.
    """

    measured: Series
    slowed: int
    outcome: str


def follow_planned(
    sine: PlannedSine, parameters: Values | None = None, *, side: Side = Side.LEFT, joint: int = AXIS_6
) -> Path:
    """Have one joint of a virtual arm follow ``sine`` at full-speed settings, with parameters of the controller."""
    controller = JointTrajectoryController(side, MemoryBuffer())
    rig = VirtualArmRig({TRAJECTORY_CONTROLLER: controller}, side=side)
    rig.manager.set_parameters(TRAJECTORY_CONTROLLER, parameters or {})
    rig.start()
    rig.switch_to(TRAJECTORY_CONTROLLER)
    rig.run(0.1)
    state = rig.line.state
    assert state is not None
    start, begin, slowed = state.planned, state.time + 0.1, rig.snapshot.limiter.slowed
    trajectory = JointTrajectory(joint_names(side), sine.points(start, joint), start=begin)
    plan = plan_trajectory(trajectory, (side,), YUMI_LIMITS)[side]
    rig.manager.receive(TRAJECTORY_CONTROLLER, FollowTrajectory(plan, goal=1), state)
    first = len(rig.cycles)
    rig.run(sine.duration + 0.5)
    states = [cycle.state for cycle in rig.cycles[first:]]
    measured = series([(each.time - begin, each.position[joint] - start[joint]) for each in states])
    return Path(measured, rig.snapshot.limiter.slowed - slowed, str(rig.events[-1]))
