from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ruckig import ControlInterface, InputParameter, Ruckig, Trajectory

from yumi.control.limiter import Reach, braking_reach

TOP, JERK = 20.0, 300.0


def planned_reach(velocity: float, acceleration: float) -> Reach:
    """The same by Ruckig, which plans the whole way."""
    given = InputParameter(1)
    given.control_interface = ControlInterface.Velocity
    given.current_velocity, given.current_acceleration = [velocity], [acceleration]
    given.max_acceleration, given.max_jerk = [TOP], [JERK]
    way = Trajectory(1)
    Ruckig(1, 0.004).calculate(given, way)
    (extremes,) = way.position_extrema
    return Reach(extremes.min, extremes.max)


@given(st.floats(-7.0, 7.0), st.floats(-TOP, TOP))
def test_reach_is_that_of_the_quickest_way_to_standstill(velocity: float, acceleration: float) -> None:
    assert braking_reach(velocity, acceleration, TOP, JERK) == pytest.approx(
        planned_reach(velocity, acceleration), abs=1e-6
    )


def test_joint_that_stands_goes_nowhere() -> None:
    assert braking_reach(0.0, 0.0, TOP, JERK) == Reach(0.0, 0.0)


def test_joint_that_is_turned_around_goes_on_a_little() -> None:
    lowest, highest = braking_reach(-0.1, TOP, TOP, JERK)
    assert -0.01 < lowest < 0.0 < highest
