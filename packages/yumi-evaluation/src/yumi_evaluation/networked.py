"""The evaluation in real time: a virtual controller, the driver and an application, each a process of its own.

The virtual controller differs from a real one by its address only. The application sends experiments' goals over
ROS 2; round trips are what it knows of them, joined with the driver's recording.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import rclpy
from builtin_interfaces.msg import Duration, Time
from controller_manager_msgs.srv import SwitchController
from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.srv import SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from yumi_interfaces.srv import LoadModule

from abb_protocols.catalogue import message
from abb_protocols.errors import RobotNotReady
from abb_protocols.robot.joints import Joints, Side, joint_names, joints
from abb_runtime.parameters import Values
from abb_runtime.process.command_process import CommandProcess
from abb_runtime.process.realtime import paused_collector
from abb_runtime.rws.client import DEFAULT_PASSWORD, DEFAULT_USER, RwsClient
from abb_runtime.rws.login import PASSWORD_VARIABLE
from abb_runtime.udp import free_port
from yumi.control.motion.robot_response import RESPONSE_DELAY
from yumi.control.motion.setpoint import largest_difference
from yumi.control.motion.spline import TrajectoryPoint
from yumi.driver.settings import address_values, override, read_settings
from yumi.recording.reader import read_recording
from yumi.ros.ros_driver import close_ros, open_ros
from yumi_evaluation.experiments import (
    AXIS_6,
    Experiment,
    Mode,
    System,
    Trace,
    better_experiments,
    joint_experiments,
    proportional,
    published_experiments,
)
from yumi_evaluation.kpis import Measured
from yumi_evaluation.metrics import Series, series
from yumi_evaluation.results import OnStep, Results
from yumi_evaluation.round_trips import (
    FILE_NAME,
    PERIOD,
    SIDE,
    TEXT,
    HeardState,
    LoopCycle,
    RoundTrip,
    SentGoal,
    join_trips,
    machine_trip,
    nudge,
    prepare,
)
from yumi_evaluation.virtual_time import goal_times, moved, planned_sine

POSITION_CONTROLLER = "joint_position_controller"
TRAJECTORY_CONTROLLER = "joint_trajectory_controller"
COUNTED = ("cycles", "missed", "lost")
"""Counters of ``egm_state`` from which packet loss follows."""

_QUEUE = QoSProfile(depth=2000)  # nothing that is measured may be lost here
_TIMEOUT = 30.0  # [s]


class HeardJointState(NamedTuple):
    """A joint state of an arm.

    Attributes:
        stamp: the time of its cycle, on the machine's monotonic clock [s].
        heard: when it came [s].
        position: measured [rad], (7,).
    """

    stamp: float
    heard: float
    position: Joints


class EvaluationNode:
    """One arm's topics and the services of the driver while ROS 2 is open; all happens in the thread that calls.

    Args:
        side: the arm.
        check: called while waiting; raises when waiting has become useless.

    Attributes:
        side: the arm.
        states: what was heard of it.
        check: as given.
    """

    def __init__(self, side: Side, check: Callable[[], None]) -> None:
        self.side = side
        self.states: list[HeardJointState] = []
        self.check = check
        # Without parameter services looking for work is quicker, and what is measured is less about the application.
        self._node = rclpy.create_node(f"evaluation_{side.value}", start_parameter_services=False)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        # From the machine's monotonic clock to the time of day [ns]; an interrupted reading is too large.
        self._behind = min(time.time_ns() - time.monotonic_ns() for _ in range(100))
        self._counters: dict[str, int] = {}
        self._callers: dict[str, Any] = {}
        namespace = side.value
        self._goals = self._node.create_publisher(JointState, f"{namespace}/joint_commands", 10)
        self._trajectories = self._node.create_publisher(
            JointTrajectory, f"{namespace}/{TRAJECTORY_CONTROLLER}/joint_trajectory", 10
        )
        self._node.create_subscription(JointState, f"{namespace}/joint_states", self._take, _QUEUE)
        self._node.create_subscription(DiagnosticStatus, f"{namespace}/egm_state", self._take_status, 10)

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._node.destroy_node()

    def start_egm(self) -> None:
        """Raises RobotNotReady with the driver's sentence."""
        self._call(Trigger, "yumi_robot_manager/start_egm", Trigger.Request())

    def stop_egm(self) -> None:
        """Raises RobotNotReady with the driver's sentence."""
        self._call(Trigger, "yumi_robot_manager/stop_egm", Trigger.Request())

    def is_ready(self) -> bool:
        """Ask the robot manager, which answers at once while EGM runs."""
        return bool(self._ask(Trigger, "yumi_robot_manager/robot_is_ready", Trigger.Request()).success)

    def load_module(self, side: Side, file_name: str, text: str) -> None:
        """Have the robot manager load a RAPID module; raises RobotNotReady with its sentence."""
        request = LoadModule.Request(arm=side.word, file_name=file_name, text=text)
        self._call(LoadModule, "yumi_robot_manager/load_module", request)

    def set_controller(self, values: Values) -> None:
        """Parameters of the arm's joint position controller.

        Raises:
            RobotNotReady: it refused one.
        """
        request = SetParameters.Request()
        request.parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        answer = self._call(SetParameters, f"{self.side.value}/{POSITION_CONTROLLER}/set_parameters", request)
        for result in answer.results:
            if not result.successful:
                raise RobotNotReady(message("parameters_not_taken", reason=result.reason))

    def switch(self, activate: str, deactivate: str) -> None:
        """Let another controller command the arm.

        Raises:
            RobotNotReady: the controller manager refused it.
        """
        request = SwitchController.Request(strictness=SwitchController.Request.STRICT)
        request.activate_controllers, request.deactivate_controllers = [activate], [deactivate]
        answer = self._call(SwitchController, f"{self.side.value}/controller_manager/switch_controller", request)
        if not answer.ok:
            raise RobotNotReady(message("controllers_not_switched", reason=getattr(answer, "message", "")))

    def send_trajectory(self, points: Sequence[TrajectoryPoint], begin: float) -> None:
        """Publish a trajectory that begins at that time [s]."""
        self.until(lambda: self._trajectories.get_subscription_count() > 0, "finding the trajectory controller")
        wall = int(begin * 1e9) + self._behind
        message = JointTrajectory(joint_names=list(joint_names(self.side)))
        message.header.stamp = Time(sec=wall // 10**9, nanosec=wall % 10**9)
        for each in points:
            nanoseconds = round(each.time * 1e9)
            point = JointTrajectoryPoint(positions=list(each.position), velocities=list(each.velocity or ()))
            point.accelerations = list(each.acceleration or ())
            point.time_from_start = Duration(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
            message.points.append(point)
        self._trajectories.publish(message)

    def position(self) -> Joints:
        """Where the arm stands now [rad], (7,)."""
        self.states.clear()
        self.until(lambda: bool(self.states) and self._goals.get_subscription_count() > 0, "hearing the arm's state")
        return self.states[-1].position

    @contextmanager
    def echoes(self) -> Iterator[list[tuple[float, float]]]:
        """When each goal came to a second listener of the topic [s], and the position of its last joint [rad]."""
        heard: list[tuple[float, float]] = []
        listener = self._node.create_subscription(
            JointState,
            f"{self.side.value}/joint_commands",
            lambda message: heard.append((time.monotonic(), message.position[-1])),
            _QUEUE,
        )
        self.until(lambda: self._goals.get_subscription_count() > 1, "hearing our own goals")
        yield heard
        self._node.destroy_subscription(listener)

    def counters(self) -> dict[str, int]:
        """The arm's counters, newer than this call."""
        self._counters = {}
        self.until(lambda: bool(self._counters), "hearing the state of EGM")
        return dict(self._counters)

    def send(self, goal: Joints) -> float:
        """Publish a goal; returns when [s]."""
        wall = time.time_ns()
        message = JointState(name=list(joint_names(self.side)), position=list(goal))
        message.header.stamp = Time(sec=wall // 10**9, nanosec=wall % 10**9)
        sent = time.monotonic()
        self._goals.publish(message)
        return sent

    def stream(self, goal_at: Callable[[float], Joints], due: Sequence[float]) -> list[tuple[float, Joints]]:
        """Publish the goal of the moment at each time of ``due`` since now [s]; returns what was sent when.

        A sender that comes late sends what is right for the moment, as the thesis's loop did.
        """
        begin, sent = time.monotonic(), []
        for moment in due:
            self.spin_until(begin + moment)
            goal = goal_at(time.monotonic() - begin)
            sent.append((self.send(goal), goal))
        return sent

    def spin_until(self, end: float) -> None:
        """Listen until that time [s]."""
        while (left := end - time.monotonic()) > 0.0:
            self.check()
            self._executor.spin_once(timeout_sec=left)

    def until(self, is_so: Callable[[], bool], what: str, timeout: float = _TIMEOUT) -> None:
        """Listen until ``is_so``.

        Raises:
            RobotNotReady: it did not become so in time.
        """
        end = time.monotonic() + timeout
        while not is_so():
            self.check()
            if time.monotonic() > end:
                raise RobotNotReady(message("did_not_happen", what=what, longest=timeout))
            self._executor.spin_once(timeout_sec=0.05)

    def _call(self, kind: Any, name: str, request: Any) -> Any:
        answer = self._ask(kind, name, request)
        if not getattr(answer, "success", True):
            raise RobotNotReady(message("text", text=answer.message))
        return answer

    def _ask(self, kind: Any, name: str, request: Any) -> Any:
        if name not in self._callers:
            self._callers[name] = self._node.create_client(kind, name)
        caller = self._callers[name]
        self.until(caller.service_is_ready, f"finding {name}")
        future = caller.call_async(request)
        self.until(future.done, name)
        return future.result()

    def _take(self, message: Any) -> None:
        stamp = message.header.stamp
        moment = (stamp.sec * 10**9 + stamp.nanosec - self._behind) * 1e-9
        self.states.append(HeardJointState(moment, time.monotonic(), joints(message.position)))

    def _take_status(self, message: Any) -> None:
        values = {pair.key: pair.value for pair in message.values}
        self._counters = {name: int(values[name]) for name in COUNTED}


DELIVERED: Values = {"tracking.feed_forward": False, "tracking.delay": RESPONSE_DELAY, **proportional(1.2).values}
"""The joint position controller as it is delivered."""

_BACK = 2e-4  # [rad] from where an arm counts as back
_STILL = 0.2  # [s]
_REST = 2.0  # [s] before each experiment, as in the thesis's program: nothing is left of the way back then
_RETURN = 15.0  # [s] at most, at reduced speed
_ATTEMPTS = 4
_LONGEST_GAP = 0.06  # [s] longer, and what was measured is about the machine
_NOTICE = 0.3  # [s] between sending a trajectory and its beginning
_ECHO = 0.1  # [s] until the last goal's state has come
_ALL = 1e9  # [s] of a recording
_READY = 60.0  # [s]
_SPARE = 20  # one more round trip in so many, since some goals are replaced before a cycle takes them


@dataclass(frozen=True, slots=True)
class NetworkedPlan:
    """How an evaluation in real time is made.

    Attributes:
        trips: round trips of each kind.
        folder: for logs and the recording.
        robot: address of a real controller, with its port if need be; None starts a virtual one.
        user, password: on it.
    """

    trips: int
    folder: Path
    robot: str | None = None
    user: str = DEFAULT_USER
    password: str = field(default=DEFAULT_PASSWORD, repr=False)

    @property
    def secrets(self) -> Mapping[str, str]:
        """The password for our commands by the environment: every user can read their arguments."""
        return {PASSWORD_VARIABLE: self.password}

    def recording(self, mode: Mode) -> Path:
        """What the driver records in that mode."""
        return self.folder / f"{mode.word}.mcap"


def networked_experiments() -> tuple[Experiment, ...]:
    """Every networked experiment, those with the same settings one after the other."""
    everything = (*published_experiments(), *better_experiments(), *joint_experiments())
    return tuple(sorted(everything, key=lambda each: each.mode is Mode.REDUCED))


def networked_step_count() -> int:
    """How often ``on_step`` is called."""
    return len(networked_experiments()) + len(Mode) + 3


def evaluate_networked(results: Results, plan: NetworkedPlan, on_step: OnStep, check: Callable[[], None]) -> None:
    """Run everything in real time into ``results``; ``on_step`` and ``check`` may raise to end it early.

    Raises:
        YumiError: a process or the robot failed; the message says which.
    """
    plan.folder.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        stack.enter_context(paused_collector())
        open_ros()
        stack.callback(close_ros)
        robot = start_robot(plan, stack, check)
        for mode in Mode:
            on_step(f"Start the driver, {mode.word}")
            found: tuple[Measured, tuple[SentGoal, ...], tuple[HeardState, ...]] | None = None
            with start_driver(plan, robot, mode, check) as driver:

                def watch(driver: CommandProcess = driver) -> None:
                    check()
                    if driver.exit_code is not None:
                        raise RobotNotReady(
                            message("driver_program_ended", exit_code=driver.exit_code, log=str(driver.log))
                        )

                _run_mode(results, mode, on_step, watch)
                if mode is Mode.FULLSPEED:
                    found = _measure_trips(plan, robot, on_step, watch)
            if found is not None:  # the recording is complete when the driver has ended
                measured, goals, states = found
                trips = join_recorded(goals, states, plan.recording(mode))[: plan.trips]
                results.measured[System.NETWORKED] = replace(measured, trips=trips)
    results.close()


def start_robot(plan: NetworkedPlan, stack: ExitStack, check: Callable[[], None]) -> tuple[str, ...]:
    """The driver's options to find the robot; a virtual one is started on free ports."""
    if plan.robot:
        where = override(read_settings(), {"robot": address_values(plan.robot)}, "evaluate").robot
        return ("--robot", where.host_and_port)
    ports = ("--left-egm-port", str(free_port()), "--right-egm-port", str(free_port()))
    arguments = ("controller", "--rws-port", "0", *ports)
    command = CommandProcess("virtual controller", "yumi", arguments, plan.folder / "controller.log", plan.secrets)
    address = stack.enter_context(command).wait_until_ready(_READY, check)
    return ("--robot", address.removeprefix("http://"), *ports)


@contextmanager
def start_driver(
    plan: NetworkedPlan, robot: Sequence[str], mode: Mode, check: Callable[[], None]
) -> Iterator[CommandProcess]:
    """The driver as shipped, but for MaxSpeedDeviation; it records every cycle."""
    speed = mode.value.max_speed_deviation
    settings = plan.folder / f"{mode.word}.yaml"
    settings.write_text(f"egm_motion: {{max_speed_deviation: {speed:.1f}}}\n", encoding="utf-8")
    what = ("--config", str(settings), "--record", str(plan.recording(mode)))
    arguments = ("up", *robot, "--user", plan.user, *what)
    with CommandProcess("driver", "yumi", arguments, plan.folder / f"driver_{mode.word}.log", plan.secrets) as command:
        command.wait_until_ready(_READY, check)
        yield command


def _run_mode(results: Results, mode: Mode, on_step: OnStep, check: Callable[[], None]) -> None:
    """The experiments with these settings; one that cannot be run does not keep the others from being run."""
    chosen = [each for each in networked_experiments() if each.mode is mode]
    for side in dict.fromkeys(each.side for each in chosen):
        with closing(EvaluationNode(side, check)) as node:
            for experiment in (each for each in chosen if each.side is side):
                on_step(experiment.title)
                name, repeats = f"{System.NETWORKED.value}/{experiment.name}", list[str]()
                try:
                    results.add(System.NETWORKED, run_undisturbed(node, experiment, repeats.append))
                except RobotNotReady as error:
                    results.failures[name] = str(error)
                if repeats:
                    results.repeats[name] = tuple(repeats)


def run_undisturbed(
    node: EvaluationNode, experiment: Experiment, on_repeat: Callable[[str], None] = lambda why: None
) -> Trace:
    """Run ``experiment``; repeat it from the same place when the machine was too busy to keep EGM running.

    Args:
        node: the application.
        experiment: what to run.
        on_repeat: called with the reason each time a run is discarded and repeated.

    Raises:
        RobotNotReady: the last attempt failed, too.
    """
    node.start_egm()
    start = node.position()
    for _ in range(_ATTEMPTS - 1):
        try:
            return run_networked(node, experiment)
        except RobotNotReady as error:
            on_repeat(str(error))
        node.start_egm()
        with suppress(RobotNotReady):
            _bring_back(node, start)
    return run_networked(node, experiment)


def run_networked(node: EvaluationNode, experiment: Experiment) -> Trace:
    """Run ``experiment`` with a running driver, in an EGM session of its own, and bring the arm back.

    No experiment begins with what the one before left to EGM, such as a filter that has not settled.

    Raises:
        RobotNotReady: the driver refused something, no state came for too long, or the arm did not come back.
    """
    node.stop_egm()
    node.start_egm()
    if experiment.controller.is_planned:
        return _run_planned(node, experiment)
    node.set_controller({**DELIVERED, **experiment.controller.values})
    node.spin_until(time.monotonic() + _REST)
    start = standing(node)
    reference, which, due = experiment.reference, experiment.moved, goal_times(experiment)
    node.states.clear()
    sent = node.stream(lambda moment: moved(start, reference(moment if len(due) > 1 else 0.0), which), due)
    begin = sent[0][0]
    node.spin_until(begin + experiment.duration)
    measured = _measured(node.states, begin, experiment.duration, start, which)
    _bring_back(node, start)
    goals = series([(moment - begin, goal[which[0]] - start[which[0]]) for moment, goal in sent])
    return Trace(experiment, goals, measured)


def _run_planned(node: EvaluationNode, experiment: Experiment) -> Trace:
    """A trajectory ends where it began: the arm need not be brought back."""
    sine, joint = planned_sine(experiment.reference), experiment.moved[0]
    node.switch(TRAJECTORY_CONTROLLER, POSITION_CONTROLLER)
    try:
        start = standing(node)
        node.states.clear()
        begin = time.monotonic() + _NOTICE
        node.send_trajectory(sine.points(start, joint), begin)
        node.spin_until(begin + sine.duration)
    finally:
        node.switch(POSITION_CONTROLLER, TRAJECTORY_CONTROLLER)
    return Trace(experiment, sine.goals(), _measured(node.states, begin, sine.duration, start, (joint,)))


def _measured(
    heard: Sequence[HeardJointState], begin: float, duration: float, start: Joints, which: Sequence[int]
) -> dict[int, Series]:
    """Where joints were since ``begin``, from ``start``.

    Raises:
        RobotNotReady: no state came for too long.
    """
    states = [state for state in heard if 0.0 <= state.stamp - begin < duration]
    times = [0.0, *(state.stamp - states[0].stamp for state in states), duration]
    gap = float(np.diff(times).max())
    if gap > _LONGEST_GAP:
        raise RobotNotReady(message("joint_states_missed", gap=gap))
    return {
        joint: series([(each.stamp - begin, each.position[joint] - start[joint]) for each in states]) for joint in which
    }


def standing(node: EvaluationNode) -> Joints:
    """Where the arm stands, once it does."""
    position = node.position()
    while True:
        node.spin_until(time.monotonic() + _STILL)
        last, position = position, node.position()
        if largest_difference(position, last) < _BACK:
            return position


def _bring_back(node: EvaluationNode, start: Joints) -> None:
    node.set_controller(DELIVERED)
    node.send(start)
    node.until(
        lambda: bool(node.states) and largest_difference(node.states[-1].position, start) < 5.0 * _BACK,
        "coming back to the start",
        _RETURN,
    )


def _measure_trips(
    plan: NetworkedPlan, robot: Sequence[str], on_step: OnStep, check: Callable[[], None]
) -> tuple[Measured, tuple[SentGoal, ...], tuple[HeardState, ...]]:
    """What the application knows of round trips; the cycles between are in the driver's recording."""
    with closing(EvaluationNode(Side.RIGHT, check)) as node:
        on_step("Round trips to the EGM loop")
        node.start_egm()
        node.set_controller(DELIVERED)
        before = node.counters()
        goals = send_nudges(node, plan.trips + plan.trips // _SPARE)
        states = tuple(HeardState(each.stamp, each.heard) for each in node.states)
        after = node.counters()
        on_step("Round trips to the robot manager")
        services = service_trips(node, plan.trips)
        node.stop_egm()
        on_step("Round trips to the state machine")
        with state_machine_client(plan, robot[1]) as client:
            requests, answers = machine_trips(node, client, plan.trips)
    machine = {"ros_service": services, "request": requests, "answer": answers}
    lost = sum(after[name] - before[name] for name in ("missed", "lost"))
    return Measured(machine_trips=machine, datagrams=after["cycles"] - before["cycles"], lost=lost), goals, states


def send_nudges(node: EvaluationNode, count: int) -> tuple[SentGoal, ...]:
    """Send goals that hardly move the arm, each with a position of its own; the states heard are in ``node.states``."""
    node.start_egm()
    start = standing(node)
    with node.echoes() as echoes:
        node.states.clear()
        begin, sent = time.monotonic() + PERIOD, []
        for number in range(count):
            node.spin_until(begin + number * PERIOD)
            goal = moved(start, nudge(number), (AXIS_6,))
            sent.append((node.send(goal), goal[AXIS_6]))
        node.spin_until(time.monotonic() + _ECHO)
    heard = {value: moment for moment, value in reversed(echoes)}
    return tuple(SentGoal(value, moment, heard.get(value, moment)) for moment, value in sent)


def join_recorded(goals: Sequence[SentGoal], states: Sequence[HeardState], recording: Path) -> tuple[RoundTrip, ...]:
    """The round trips of ``goals``, with the cycles of the driver's ``recording``, which is complete."""
    frames = read_recording(recording, before=_ALL, after=_ALL).frames.get(Side.RIGHT, ())
    cycles = [
        LoopCycle(frame.time, frame.time + frame.stages.reply, frame.reference[AXIS_6])
        for frame in frames
        if frame.reference is not None
    ]
    return join_trips(goals, cycles, states)


def state_machine_client(plan: NetworkedPlan, address: str) -> RwsClient:
    """A client without request pacing for a virtual controller, with it for a real one; not connected yet."""
    client = RwsClient(address, user=plan.user, password=plan.password)
    if not plan.robot:
        client.lift_rate_limit()
    return client


def service_trips(node: EvaluationNode, count: int) -> tuple[float, ...]:
    """Calls of the driver's robot manager [s]."""
    node.is_ready()  # discovery is no round trip
    durations = []
    for _ in range(count):
        begin = time.monotonic()
        node.is_ready()
        durations.append(time.monotonic() - begin)
    return tuple(durations)


def machine_trips(node: EvaluationNode, client: RwsClient, count: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Round trips to the idle state machine and back: until it has been asked, and until its answer has come [s].

    Raises:
        RobotNotReady: it did not answer.
    """
    node.load_module(SIDE, FILE_NAME, TEXT)
    prepare(client)
    trips = [machine_trip(client, str(number), time.monotonic, node.check) for number in range(count)]
    requests, answers = zip(*trips, strict=True)
    return requests, answers
