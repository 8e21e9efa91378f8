"""An evaluation's application over ROS 2 and the network; with a driver and a robot it is in ``test_ros_records``."""

from __future__ import annotations

from contextlib import nullcontext

import pytest

from abb_protocols.errors import RobotNotReady
from yumi_evaluation import networked
from yumi_evaluation.experiments import Experiment, Trace, proportional, step
from yumi_evaluation.metrics import series
from yumi_evaluation.networked import (
    run_undisturbed,
)

pytestmark = pytest.mark.ros


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
