"""An evaluation's application over ROS 2 and the network: an experiment, and round trips joined with the recording."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path

import pytest
from ros_bench import TIMEOUT, Robot

from yumi.errors import RobotNotReady
from yumi.process.supervision import Command
from yumi.robot.joints import Side
from yumi_evaluation import networked
from yumi_evaluation.experiments import Experiment, Trace, proportional, step, step_figures_of
from yumi_evaluation.metrics import series
from yumi_evaluation.networked import (
    EvaluationNode,
    NetworkedPlan,
    evaluation_node,
    join_recorded,
    machine_trips,
    run_undisturbed,
    send_nudges,
    service_trips,
    state_machine_client,
)
from yumi_evaluation.round_trips import HeardState

# A machine that stands still for 100 ms ends EGM in the middle of a motion.
pytestmark = [pytest.mark.ros, pytest.mark.real_time, pytest.mark.timeout(120)]


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    return tmp_path / "session.mcap"


@pytest.fixture
def driver(ros: None, robot: Robot, recording: Path, tmp_path: Path) -> Iterator[Command]:
    where = ["--robot", f"127.0.0.1:{robot.rws_port}", *robot.egm_options]
    with Command("driver", ["up", *where, "--record", str(recording)], tmp_path / "driver.log") as command:
        command.wait_until_ready(2 * TIMEOUT)
        yield command


@pytest.fixture
def node(driver: Command) -> Iterator[EvaluationNode]:
    with evaluation_node(Side.RIGHT, lambda: None) as node:
        yield node


class BusyMachine:
    """Disturbs so many runs."""

    def __init__(self, disturbed: int) -> None:
        self.disturbed = disturbed

    def start_egm(self) -> None: ...

    def position(self) -> None: ...

    def run(self, node: object, experiment: Experiment) -> Trace:
        self.disturbed -= 1
        if self.disturbed >= 0:
            raise RobotNotReady("No joint state came for 90 ms.")
        return Trace(experiment, series(()), {})


@pytest.mark.parametrize(("disturbed", "repeats"), [(0, 0), (2, 2), (4, 3)])
def test_disturbed_runs_are_repeated_and_reported(
    monkeypatch: pytest.MonkeyPatch, disturbed: int, repeats: int
) -> None:
    machine, reported = BusyMachine(disturbed), list[str]()
    monkeypatch.setattr(networked, "run_networked", machine.run)
    monkeypatch.setattr(networked, "_bring_back", lambda node, start: None)
    with pytest.raises(RobotNotReady) if disturbed > 3 else nullcontext():
        run_undisturbed(machine, step(proportional(1.2)), reported.append)  # type: ignore[arg-type]
    assert reported == ["No joint state came for 90 ms."] * repeats


def test_step_settles_and_round_trips_are_joined_with_the_recording(
    node: EvaluationNode, driver: Command, robot: Robot, recording: Path
) -> None:
    figures = step_figures_of(run_undisturbed(node, step(proportional(1.6), duration=1.5)))
    goals = send_nudges(node, 100)
    states = [HeardState(each.stamp, each.heard) for each in node.states]
    with state_machine_client(NetworkedPlan(20, recording.parent), f"127.0.0.1:{robot.rws_port}") as machine:
        services = service_trips(node, 20)
        node.stop_egm()
        legs = machine_trips(node, machine, 20)
    driver.stop()
    trips = join_recorded(goals, states, recording)
    assert figures.final_error_deg < 0.1
    assert len(trips) > 20
    assert all(trip.total > 0.008 for trip in trips)
    assert [len(times) for times in (services, *legs)] == [20, 20, 20]
