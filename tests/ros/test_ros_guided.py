"""EGM for the time of a block, however the block is left; without a driver."""

from __future__ import annotations

import pytest

from yumi.errors import GoalNotReached, RobotNotReady
from yumi.ros.robot_manager_client import RobotManagerClient

pytestmark = pytest.mark.ros


class Client(RobotManagerClient):
    """Notes what is asked; ``start`` and ``stop`` raise what they hold."""

    def __init__(self, start: BaseException | None = None, stop: BaseException | None = None) -> None:
        self.asked: list[str] = []
        self._raised = {"start": start, "stop": stop}

    def start_egm(self) -> str:
        return self._ask("start")

    def stop_egm(self) -> str:
        return self._ask("stop")

    def _ask(self, what: str) -> str:
        self.asked.append(what)
        error = self._raised[what]
        if error is not None:
            raise error
        return what


def test_egm_ends_with_the_block() -> None:
    client, told = Client(), []
    with client.egm_running(told.append):
        assert client.asked == ["start"]
    assert client.asked == told == ["start", "stop"]


@pytest.mark.parametrize("error", [KeyboardInterrupt(), GoalNotReached("It was stopped.")])
def test_egm_ends_when_the_block_fails_and_its_error_stays(error: BaseException) -> None:
    client = Client(stop=RobotNotReady("The controller does not answer."))
    with pytest.raises(type(error)), client.egm_running():
        raise error
    assert client.asked == ["start", "stop"]


def test_egm_ends_when_ctrl_c_comes_while_it_starts() -> None:
    client = Client(start=KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt), client.egm_running():
        pytest.fail("it did not start")
    assert client.asked == ["start", "stop"]


def test_egm_that_did_not_start_is_not_ended() -> None:
    client = Client(start=RobotNotReady("The controller is in MANR."))
    with pytest.raises(RobotNotReady, match="MANR"), client.egm_running():
        pytest.fail("it did not start")
    assert client.asked == ["start"]
