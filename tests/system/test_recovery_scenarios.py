"""What may happen to a robot in mid-motion, each from noticing it to moving again, without a restart and a jump."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from system.recovery_bench import MovingSystem
from yumi.errors import RobotNotReady
from yumi.robot.joints import Side

NO_JUMP = 1.001


@pytest.fixture
def system() -> MovingSystem:
    return MovingSystem()


def be_silent(system: MovingSystem, seconds: float) -> None:
    """The network loses the arms' datagrams, both ways; the controller goes on."""
    system.is_wired = False
    system.wait(seconds)
    system.is_wired = True
    system.wait(0.05)


@pytest.mark.parametrize(
    ("happens", "why"),
    [
        (lambda faults: faults.stop_program(), "10125 Program stopped: the RAPID program was stopped, on the pendant"),
        (lambda faults: faults.switch_motors_off(), "10010 Motors OFF: the motors were switched off"),
        (lambda faults: faults.collide(Side.LEFT), "50204 Motion supervision: an arm has collided"),
    ],
    ids=["program stopped", "motors off", "collision"],
)
def test_robot_moves_again_after_what_needs_nobody(
    system: MovingSystem, happens: Callable[[object], None], why: str
) -> None:
    happens(system.faults)
    system.wait(0.2)
    assert not any(arm.snapshot.is_commanded for arm in system.arms.values())
    told = system.recover()
    assert told.startswith(f"The robot was stopped by {why}")
    assert told.endswith("EGM runs on both arms, the controllers are active.")
    assert system.is_moving_again()
    assert system.largest_jump < NO_JUMP


@pytest.mark.parametrize(
    ("happens", "ends", "sentence"),
    [
        (
            lambda faults: faults.press_emergency_stop(),
            lambda faults: faults.release_emergency_stop(),
            "10013 Emergency stop: .* Motors do not go on, .* an emergency stop is pressed; release it",
        ),
        (
            lambda faults: faults.select_manual_mode(),
            lambda faults: faults.select_automatic_mode(),
            "10015 Manual mode selected: .* The controller is in MANR; turn it to AUTO on the pendant",
        ),
    ],
    ids=["emergency stop", "manual mode"],
)
def test_recovery_says_what_somebody_has_to_do_first(
    system: MovingSystem, happens: Callable[[object], None], ends: Callable[[object], None], sentence: str
) -> None:
    happens(system.faults)
    system.wait(0.2)
    with pytest.raises(RobotNotReady, match=sentence):
        system.recover()
    ends(system.faults)
    system.recover()
    assert system.is_moving_again()
    assert system.largest_jump < NO_JUMP
