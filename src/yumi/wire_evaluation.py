"""The evaluation in real time: a virtual controller, the driver and an application, three processes and more.

Only addresses tell the virtual controller from a real one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from yumi.errors import RobotNotReady
from yumi.evaluation.evaluation_results import OnStep, Results
from yumi.evaluation.experiment import Experiment, Mode, System
from yumi.evaluation.experiments import better_experiments, joint_experiments, published_experiments
from yumi.evaluation.kpis import Measured
from yumi.evaluation.loop_trips import HeardState, SentGoal
from yumi.evaluation.robot_place import RobotPlace
from yumi.links.command import Command
from yumi.links.realtime import paused_collector
from yumi.links.udp import free_port
from yumi.robot.joints import Side
from yumi.ros.driver import close_ros, open_ros
from yumi.ros.evaluation_node import EvaluationNode, evaluation_node
from yumi.wire_runs import USUAL, run_undisturbed
from yumi.wire_trips import join_recorded, machine_trips, send_nudges, service_trips, state_machine_client

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
