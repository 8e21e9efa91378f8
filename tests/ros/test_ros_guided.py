"""EGM for the time of a block, however the block is left; without a driver."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from yumi.errors import GoalNotReached, RobotNotReady, StopNotConfirmed
from yumi.ros.clients import RobotManagerClient

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


class Ended:
    """A future that is done."""

    def __init__(self, value: object) -> None:
        self.result = lambda: value

    def done(self) -> bool:
        return True


class FailedRecovery(RobotManagerClient):
    """A client whose action "recover" fails with a message, and with the state that was read after it."""

    def __init__(self, message: str, stop: str) -> None:
        result = SimpleNamespace(success=False, message=message, state=SimpleNamespace(stop=stop))
        handle = SimpleNamespace(get_result_async=lambda: Ended(SimpleNamespace(result=result)))
        action = SimpleNamespace(server_is_ready=lambda: True, send_goal_async=lambda *_, **__: Ended(handle))
        self._actions = {"recover": action}
        self._spinner = cast("Any", SimpleNamespace(until=lambda *_: None))


def test_client_offers_the_id_of_a_stop_only_with_its_own_text() -> None:
    with pytest.raises(RobotNotReady, match="10013-1-aaaaaa") as failed:
        FailedRecovery("The stop 10013-1-aaaaaa is open. It did not become idle.", "50204-3-bbbbbb").recover()
    assert failed.value.stop == ""
    with pytest.raises(StopNotConfirmed, match="50204-3-bbbbbb") as refused:
        FailedRecovery("Call recover with the id 50204-3-bbbbbb.", "50204-3-bbbbbb").recover()
    assert refused.value.stop == "50204-3-bbbbbb"
