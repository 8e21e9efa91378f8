from __future__ import annotations

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from ruckig import ControlInterface, InputParameter, Ruckig, Trajectory

from yumi.control.motion.joint_steps import BrakingPath, braking_path

TOP, JERK = 20.0, 300.0


def planned_path(velocity: float, acceleration: float) -> BrakingPath:
    """The same by Ruckig, which plans the whole way."""
    given = InputParameter(1)
    given.control_interface = ControlInterface.Velocity
    given.current_velocity, given.current_acceleration = [velocity], [acceleration]
    given.max_acceleration, given.max_jerk = [TOP], [JERK]
    way = Trajectory(1)
    Ruckig(1, 0.004).calculate(given, way)
    (extremes,) = way.position_extrema
    return BrakingPath(extremes.min, extremes.max, way.at_time(way.duration)[0][0])


@example(-0.5, 18.0)  # turned round, it rests behind the place it started from
@example(0.5, -18.0)
@given(st.floats(-7.0, 7.0), st.floats(-TOP, TOP))
def test_path_is_the_quickest_way_to_standstill(velocity: float, acceleration: float) -> None:
    found, planned = braking_path(velocity, acceleration, TOP, JERK), planned_path(velocity, acceleration)
    assert tuple(found) == pytest.approx(tuple(planned), abs=1e-6)
    assert found.lowest <= 0.0 <= found.highest


def test_joint_that_stands_goes_nowhere() -> None:
    assert braking_path(0.0, 0.0, TOP, JERK) == BrakingPath(0.0, 0.0, 0.0)


def test_joint_that_is_turned_around_goes_on_a_little() -> None:
    lowest, highest, end = braking_path(-0.1, TOP, TOP, JERK)
    assert -0.01 < lowest < 0.0 < highest == end
