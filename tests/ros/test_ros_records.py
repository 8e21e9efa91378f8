"""What the driver writes down: the whole session of an evaluation, and a flight record when the robot is lost in it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from math import inf
from pathlib import Path

import pytest
from ros_bench import TIMEOUT, Client, Robot
from std_srvs.srv import Trigger

from abb_protocols.robot.joints import Side
from abb_runtime.process.command_process import CommandProcess
from yumi.recording.reader import Recording, read_recording
from yumi.recording.tables import rows
from yumi_evaluation.experiments import AXIS_6, proportional, step, step_figures_of
from yumi_evaluation.networked import (
    EvaluationNode,
    NetworkedPlan,
    join_recorded,
    machine_trips,
    run_undisturbed,
    send_nudges,
    service_trips,
    state_machine_client,
)
from yumi_evaluation.round_trips import HeardState, SentGoal

# A machine that stands still for 100 ms ends EGM in the middle of a motion.
pytestmark = [pytest.mark.ros, pytest.mark.real_time, pytest.mark.timeout(180)]
COUNT = 20


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("records")


@pytest.fixture(scope="module")
def driver(ros: None, robot: Robot, folder: Path) -> Iterator[CommandProcess]:
    settings = folder / "mine.yaml"
    settings.write_text(f"recorder: {{folder: {folder / 'flights'}}}\n")
    where = ["--robot", f"127.0.0.1:{robot.rws_port}", *robot.egm_options]
    what = ["--config", str(settings), "--record", str(folder / "session.mcap")]
    with CommandProcess("driver", "yumi", ["up", *where, *what], folder / "driver.log") as command:
        command.wait_until_ready(2 * TIMEOUT)
        yield command
    robot.start()


@dataclass(frozen=True, slots=True)
class Session:
    """What one driver did, from an experiment to the power cut of its robot.

    Attributes:
        file: its recording, complete.
        error_deg: of the step at its end.
        goals: when each was sent, and where to.
        states: the joint states that were heard.
        trips: the times of calls: of a service, and both legs of a state machine's.
        flights: the record of each arm's loss.
    """

    file: Path
    error_deg: float
    goals: Sequence[SentGoal]
    states: Sequence[HeardState]
    trips: Sequence[Sequence[float]]
    flights: Mapping[Side, Recording]


@pytest.fixture(scope="module")
def session(driver: CommandProcess, robot: Robot, folder: Path) -> Session:
    with closing(EvaluationNode(Side.RIGHT, lambda: None)) as node:
        figures = step_figures_of(run_undisturbed(node, step(proportional(1.6), duration=1.5)))
        goals = send_nudges(node, 100)
        states = [HeardState(each.stamp, each.heard) for each in node.states]
        with state_machine_client(NetworkedPlan(COUNT, folder), f"127.0.0.1:{robot.rws_port}") as machine:
            services = service_trips(node, COUNT)
            node.stop_egm()
            legs = machine_trips(node, machine, COUNT)
    client = Client()
    assert client.call(Trigger, "yumi_robot_manager/start_egm").success
    robot.kill()
    client.until(lambda: sum("s of the" in sentence for sentence in client.sentences) == 2)
    client.close()
    newest = {side: max((folder / "flights").glob(f"*_{side.word}.mcap")) for side in Side}
    flights = {side: read_recording(file) for side, file in newest.items()}
    driver.stop()
    return Session(folder / "session.mcap", figures.final_error_deg, goals, states, [services, *legs], flights)


def test_step_settles_and_round_trips_are_joined_with_the_recording(session: Session) -> None:
    trips = join_recorded(session.goals, session.states, session.file)
    assert session.error_deg < 0.1
    # How many of the goals a cycle took, and how many states were heard, is up to the machine.
    frames = read_recording(session.file, before=inf, after=inf).frames[Side.RIGHT]
    led_to = {frame.reference[AXIS_6] for frame in frames if frame.reference is not None}
    taken = [goal for goal in session.goals if goal.value in led_to]
    assert taken
    assert len(taken) / 2 < len(trips) <= len(taken)
    assert all(trip.total > 0.008 for trip in trips)
    assert [len(times) for times in session.trips] == [COUNT, COUNT, COUNT]


def test_power_cut_leaves_flight_records_of_both_arms_and_the_recording_goes_on(session: Session) -> None:
    recording = read_recording(session.file)
    assert recording.is_complete
    for side, flight in session.flights.items():
        assert flight.stop in recording.events
        assert flight.stop is not None
        assert flight.stop.kind == "SessionLost"
        assert flight.frames[side][-1] == recording.frames[side][-1]
        # Where the machine was late the core has answered, and braked: of such a cycle no controller has times.
        by_core = [frame for frame in flight.frames[side] if frame.stages.reply == 0.0]
        assert len(by_core) < 0.1 * len(flight.frames[side])
        assert all(frame.desired is None and frame.reference is None for frame in by_core)
    # Beside the cycles it holds what became of the robot and its grippers.
    states = list(rows(session.file, "state"))
    assert {row["egm.r"] for row in states} >= {"off", "running"}
    assert [row["is_connected"] for row in states][-1] is False
    assert {row["arm"] for row in rows(session.file, "grippers")} == {"right", "left"}
