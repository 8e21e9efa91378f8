"""The evaluation in real time: a virtual controller, the driver and an application, three processes and more.

Only addresses tell the virtual controller from a real one.

Experiments over ROS 2 and the wire, with a driver that is up.

Round trips over ROS 2 and the wire: what the application knows of them, joined with the driver's recording.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

from yumi.clock import SystemClock
from yumi.control.controllers.joint_position import DELAY
from yumi.egm.udp import free_port
from yumi.errors import RobotNotReady
from yumi.process.child import Command
from yumi.process.realtime import paused_collector
from yumi.recording.mcap import read_recording
from yumi.robot.joints import Joints, Side
from yumi.ros.driver import close_ros, open_ros
from yumi.rws.client import RwsClient
from yumi.settings import Values
from yumi_evaluation.evaluation_node import (
    POSITION_CONTROLLER,
    TRAJECTORY_CONTROLLER,
    EvaluationNode,
    HeardJointState,
    evaluation_node,
)
from yumi_evaluation.experiment import Experiment, Mode, Sine, System, Trace, proportional
from yumi_evaluation.experiments import RobotPlace, better_experiments, joint_experiments, published_experiments
from yumi_evaluation.kpis import Measured
from yumi_evaluation.results import OnStep, Results
from yumi_evaluation.round_trips import (
    FILE_NAME,
    PERIOD,
    SIDE,
    TEXT,
    HeardState,
    LoopCycle,
    SentGoal,
    Trip,
    join_trips,
    machine_trip,
    nudge,
    prepare,
)
from yumi_evaluation.virtual_machine import goal_times, moved, planned_goals, planned_sine

USUAL: Values = {"tracking.feed_forward": False, "tracking.delay": DELAY, **proportional(1.2).values}
"""The joint position controller as it is delivered."""

_BACK = 2e-4  # [rad] from where an arm is taken to be back
_STILL = 0.2  # [s]
_REST = 2.0  # [s] before each experiment, as in the publication's program: nothing is left of the way back then
_RETURN = 15.0  # [s] at most, at reduced speed
_ATTEMPTS = 4
_LONGEST_GAP = 0.06  # [s] longer, and what was measured is about the machine
_NOTICE = 0.3  # [s] between sending a trajectory and its beginning


def run_undisturbed(
    node: EvaluationNode, experiment: Experiment, on_repeat: Callable[[str], None] = lambda why: None
) -> Trace:
    """Again, from the same place, when the machine was too busy to keep EGM alive: that says nothing of control.

    Args:
        node: the application.
        experiment: what is asked.
        on_repeat: told why, each time a run is thrown away and made again.

    Raises:
        RobotNotReady: the last attempt failed, too.
    """
    node.start_egm()
    start = node.position()
    for _ in range(_ATTEMPTS - 1):
        try:
            return run_on_wire(node, experiment)
        except RobotNotReady as error:
            on_repeat(str(error))
        node.start_egm()
        with suppress(RobotNotReady):
            _bring_back(node, start)
    return run_on_wire(node, experiment)


def run_on_wire(node: EvaluationNode, experiment: Experiment) -> Trace:
    """Run ``experiment`` with a driver that is up, in an EGM session of its own, and bring the arm back.

    The robot takes one reply a cycle from its queue: a reply that once came too late to its cycle leaves all commands
    after it a cycle late, until the session ends (reference/egm.md §4.3).

    Raises:
        RobotNotReady: the driver refused something, no state came for too long, or the arm did not come back.
    """
    node.stop_egm()
    node.start_egm()
    if experiment.law.is_planned:
        return _run_planned(node, experiment)
    node.set_law({**USUAL, **experiment.law.values})
    node.spin_until(time.monotonic() + _REST)
    start = standing(node)
    reference, which = experiment.reference, experiment.moved
    due = list(goal_times(experiment))
    node.states.clear()
    sent = node.stream(lambda moment: moved(start, reference(moment if len(due) > 1 else 0.0), which), due)
    begin = sent[0][0]
    node.spin_until(begin + experiment.duration)
    states = [state for state in node.states if 0.0 <= state.stamp - begin < experiment.duration]
    measured = {
        joint: [(each.stamp - begin, each.position[joint] - start[joint]) for each in states] for joint in which
    }
    _check_gaps(experiment.duration, states)
    _bring_back(node, start)
    joint = which[0]
    return Trace(experiment, [(moment - begin, goal[joint] - start[joint]) for moment, goal in sent], measured)


def _run_planned(node: EvaluationNode, experiment: Experiment) -> Trace:
    """A trajectory that ends where it began; nothing has to be brought back."""
    reference, (joint, *_) = experiment.reference, experiment.moved
    assert isinstance(reference, Sine), "trajectories are measured with sines"
    sine = planned_sine(reference)
    node.switch(TRAJECTORY_CONTROLLER, POSITION_CONTROLLER)
    try:
        start = standing(node)
        node.states.clear()
        begin = time.monotonic() + _NOTICE
        node.send_trajectory(sine.points(start, joint), begin)
        node.spin_until(begin + sine.duration)
    finally:
        node.switch(POSITION_CONTROLLER, TRAJECTORY_CONTROLLER)
    states = [state for state in node.states if 0.0 <= state.stamp - begin < sine.duration]
    _check_gaps(sine.duration, states)
    measured = [(each.stamp - begin, each.position[joint] - start[joint]) for each in states]
    return Trace(experiment, planned_goals(sine), {joint: measured})


def _check_gaps(duration: float, states: Sequence[HeardJointState]) -> None:
    times = [0.0, *(state.stamp - states[0].stamp for state in states), duration]
    gap = max(new - old for old, new in pairwise(times))
    if gap > _LONGEST_GAP:
        raise RobotNotReady(
            f"No joint state came for {1e3 * gap:.0f} ms: the machine is too busy, or the robot was lost; "
            "try again when it is idle."
        )


def standing(node: EvaluationNode) -> Joints:
    """Where the arm stands, once it does."""
    position = node.position()
    while True:
        node.spin_until(time.monotonic() + _STILL)
        last, position = position, node.position()
        if max(abs(now - before) for now, before in zip(position, last, strict=True)) < _BACK:
            return position


def _bring_back(node: EvaluationNode, start: Joints) -> None:
    node.set_law(USUAL)
    node.send(start)

    def is_back() -> bool:
        now = node.states[-1].position if node.states else None
        return now is not None and max(abs(a - b) for a, b in zip(now, start, strict=True)) < 5.0 * _BACK

    node.until(is_back, "coming back to the start", _RETURN)


AXIS_6 = 6
"""By its place in the chain: the last, by which echoes of goals are known."""

_ECHO = 0.1  # [s] until the last goal's state has come
_ALL = 1e9  # [s] of a recording


class _Unpaced(SystemClock):
    """A virtual controller bears any number of requests a second, a real one fewer than twenty."""

    def wait(self, seconds: float) -> None:
        """Do not."""


def send_nudges(node: EvaluationNode, count: int) -> tuple[SentGoal, ...]:
    """Send goals that hardly move the arm, each with a position of its own; what was heard is in ``node.states``."""
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


def join_recorded(goals: Sequence[SentGoal], states: Sequence[HeardState], recording: Path) -> tuple[Trip, ...]:
    """The round trips of ``goals``, with the cycles of the driver's ``recording``, which is complete."""
    frames = read_recording(recording, before=_ALL, after=_ALL).frames.get(Side.RIGHT, ())
    cycles = [
        LoopCycle(frame.time, frame.time + frame.stages.reply, frame.reference[AXIS_6])
        for frame in frames
        if frame.reference is not None
    ]
    return join_trips(goals, cycles, states)


def state_machine_client(place: RobotPlace, address: str) -> RwsClient:
    """Asks a virtual controller as often as it answers, a real one at the pace it bears; not connected yet."""
    clock = SystemClock() if place.robot else _Unpaced()
    return RwsClient(address, user=place.user, password=place.password, clock=clock)


def service_trips(node: EvaluationNode, count: int) -> tuple[float, ...]:
    """Calls of the driver's robot manager [s]."""
    node.is_ready()  # finding each other is no round trip
    return tuple(_lasted(node.is_ready) for _ in range(count))


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


def _lasted(call: Callable[[], object]) -> float:
    begin = time.monotonic()
    call()
    return time.monotonic() - begin


_READY = 60.0  # [s]
_SPARE = 20  # one more round trip in so many, since some goals are replaced before a cycle takes them


@dataclass(frozen=True, slots=True)
class WirePlan:
    """How an evaluation in real time is made.

    Attributes:
        place: where the robot is.
        trips: round trips of each kind.
        folder: for logs and the recording.
    """

    place: RobotPlace
    trips: int
    folder: Path


def wire_experiments() -> tuple[Experiment, ...]:
    """Every experiment that runs over the wire, those with the same settings one after the other."""
    everything = (*published_experiments(), *better_experiments(), *joint_experiments())
    return tuple(sorted(everything, key=lambda each: each.mode is Mode.REDUCED))


def wire_step_count() -> int:
    """How often ``on_step`` is called."""
    return len(wire_experiments()) + len(Mode) + 3


def evaluate_on_wire(results: Results, plan: WirePlan, on_step: OnStep, check: Callable[[], None]) -> None:
    """Run everything in real time into ``results``; ``on_step`` and ``check`` may raise to end it early.

    Raises:
        YumiError: a process or the robot failed; the message says which.
    """
    plan.folder.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        stack.enter_context(paused_collector())
        open_ros()
        stack.callback(close_ros)
        where = _robot(plan, stack, check)
        for mode in Mode:
            on_step(f"Start the driver, {mode.word}")
            with _driver(plan, where, mode, check) as driver:
                watch = _watching(driver, check)
                _run_mode(results, mode, on_step, watch)
                heard = _measure_trips(plan, where, on_step, watch) if mode is Mode.FULLSPEED else None
            if heard is not None:  # the recording is complete when the driver has ended
                results.measured[System.WIRE] = replace(
                    heard.measured, trips=join_recorded(heard.goals, heard.states, _recording(plan, mode))[: plan.trips]
                )
    results.close()


def _run_mode(results: Results, mode: Mode, on_step: OnStep, check: Callable[[], None]) -> None:
    chosen = [each for each in wire_experiments() if each.mode is mode]
    for side in Side:
        mine = [each for each in chosen if each.side is side]
        if mine:
            with evaluation_node(side, check) as node:
                for experiment in mine:
                    on_step(experiment.title)
                    _add_run(results, node, experiment)


def _add_run(results: Results, node: EvaluationNode, experiment: Experiment) -> None:
    """One that cannot be run does not keep the others from being run."""
    name, repeats = f"{System.WIRE.value}/{experiment.name}", list[str]()
    try:
        results.add(System.WIRE, run_undisturbed(node, experiment, repeats.append))
    except RobotNotReady as error:
        results.failures[name] = str(error)
    if repeats:
        results.repeats[name] = tuple(repeats)


@dataclass(frozen=True, slots=True)
class _Heard:
    """What the application knows of round trips; the cycles between are in the driver's recording."""

    goals: tuple[SentGoal, ...]
    states: tuple[HeardState, ...]
    measured: Measured


def _measure_trips(plan: WirePlan, where: Sequence[str], on_step: OnStep, check: Callable[[], None]) -> _Heard:
    with evaluation_node(Side.RIGHT, check) as node:
        on_step("Round trips to the EGM loop")
        node.start_egm()
        node.set_law(USUAL)
        before = node.counters()
        goals = send_nudges(node, plan.trips + plan.trips // _SPARE)
        states = tuple(HeardState(each.stamp, each.heard) for each in node.states)
        after = node.counters()
        on_step("Round trips to the robot manager")
        services = service_trips(node, plan.trips)
        node.stop_egm()
        on_step("Round trips to the state machine")
        with state_machine_client(plan.place, f"{where[1]}:{where[3]}") as client:
            requests, answers = machine_trips(node, client, plan.trips)
        machine = {"ros_service": services, "request": requests, "answer": answers}
    lost = sum(after[name] - before[name] for name in ("missed", "lost"))
    measured = Measured(machine_trips=machine, datagrams=after["cycles"] - before["cycles"], lost=lost)
    return _Heard(goals, states, measured)


def _robot(plan: WirePlan, stack: ExitStack, check: Callable[[], None]) -> tuple[str, ...]:
    """The driver's options to find the robot; a virtual one is started on ports nobody uses."""
    if plan.place.robot:
        return ("--robot", plan.place.robot, "--rws-port", str(plan.place.rws_port))
    ports = ("--left-egm-port", str(free_port()), "--right-egm-port", str(free_port()))
    arguments = ("controller", "--rws-port", "0", *ports)
    command = Command("virtual controller", arguments, plan.folder / "controller.log", plan.place.secrets)
    address = stack.enter_context(command).wait_until_ready(_READY, check)
    host, _, port = address.removeprefix("http://").partition(":")
    return ("--robot", host, "--rws-port", port, *ports)


@contextmanager
def _driver(plan: WirePlan, where: Sequence[str], mode: Mode, check: Callable[[], None]) -> Iterator[Command]:
    """The driver as shipped, but for MaxSpeedDeviation; it records every cycle."""
    settings = plan.folder / f"{mode.word}.yaml"
    settings.write_text(
        f"egm_motion: {{max_speed_deviation: {mode.value.max_speed_deviation:.1f}}}\n", encoding="utf-8"
    )
    what = ("--config", str(settings), "--record", str(_recording(plan, mode)))
    arguments = ("up", *where, "--user", plan.place.user, *what)
    with Command("driver", arguments, plan.folder / f"driver_{mode.word}.log", plan.place.secrets) as command:
        command.wait_until_ready(_READY, check)
        yield command


def _recording(plan: WirePlan, mode: Mode) -> Path:
    return plan.folder / f"{mode.word}.mcap"


def _watching(driver: Command, check: Callable[[], None]) -> Callable[[], None]:
    def watch() -> None:
        check()
        if driver.exit_code is not None:
            raise RobotNotReady(f"The driver has ended (exit code {driver.exit_code}); see {driver.log}.")

    return watch
