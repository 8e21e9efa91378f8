"""A vacuum module in virtual time: build-up, leak, release."""

import pytest

from abb_protocols.robot.gripper_values import ATMOSPHERIC_PRESSURE
from virtual_irc5.mechanics.virtual_gripper import DEEPEST_VACUUM, OPEN_CUP_PRESSURE, CupObject, VacuumCup


def sucking(under: CupObject | None, seconds: float = 2.0) -> VacuumCup:
    cup = VacuumCup(under)
    cup.suck(is_on=True)
    cup.advance(seconds)
    return cup


def test_vacuum_takes_tenths_of_a_second_to_build_up() -> None:
    assert 0.45 * ATMOSPHERIC_PRESSURE < sucking(CupObject(), 0.1).pressure < 0.65 * ATMOSPHERIC_PRESSURE
    assert sucking(CupObject(), 1.0).pressure == pytest.approx(DEEPEST_VACUUM, rel=0.01)


def test_cup_with_nothing_under_it_sucks_air() -> None:
    assert sucking(None).pressure == pytest.approx(OPEN_CUP_PRESSURE)


def test_leak_keeps_the_pressure_up() -> None:
    assert sucking(CupObject(leak=0.5)).pressure == pytest.approx((DEEPEST_VACUUM + OPEN_CUP_PRESSURE) / 2)


def test_object_that_is_lost_lets_the_air_in() -> None:
    cup = sucking(CupObject())
    cup.under = None
    cup.advance(1.0)
    assert cup.pressure == pytest.approx(OPEN_CUP_PRESSURE, rel=0.01)


def test_blow_off_releases_at_once_and_switching_off_takes_longer() -> None:
    blown, left = sucking(CupObject()), sucking(CupObject())
    blown.blow(is_on=True)
    left.suck(is_on=False)
    for cup in (blown, left):
        cup.advance(0.1)
    assert (blown.sucks, blown.blows) == (False, True)
    assert blown.pressure > 0.99 * ATMOSPHERIC_PRESSURE > left.pressure


@pytest.mark.parametrize("dt", [0.004, 0.1, 1.0])
def test_pressure_does_not_depend_on_how_time_is_divided(dt: float) -> None:
    cup = sucking(CupObject(), 0.0)
    for _ in range(round(1.0 / dt)):
        cup.advance(dt)
    assert cup.pressure == pytest.approx(sucking(CupObject(), 1.0).pressure)


@pytest.mark.parametrize("leak", [-0.1, 1.1])
def test_leak_that_is_none_is_refused(leak: float) -> None:
    with pytest.raises(ValueError, match=r"0 \(tight\) to 1 \(open\) are allowed"):
        CupObject(leak)
