"""The services of one hand: calibration, jog, stop, error, vacuum and blow-off."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from std_srvs.srv import SetBool, Trigger

from yumi.errors import CommandRefused, RobotNotReady, YumiError
from yumi.hardware.gripper import Gripper
from yumi.hardware.vacuum import CHANNELS
from yumi.ros.gripper_action import HandTurn

Action = Callable[[], str]


class GripperServices:
    """Serves calibrate, jog_open, jog_close, stop, clear_error, vacuum_1, blow_1, vacuum_2, blow_2.

    What the hand does not have is refused.

    Args:
        node: the gripper's node.
        gripper: the hand.
        group: callback group for what takes seconds.
        why_not: why nothing may move now; None when it may.
        turn: shared by all that moves the fingers.
        calibrate: calibrates the hand.
    """

    def __init__(
        self,
        node: Any,
        gripper: Gripper,
        group: Any,
        why_not: Callable[[], str | None],
        turn: HandTurn,
        calibrate: Callable[[Gripper], None],
    ) -> None:
        self._log = node.get_logger()
        self._gripper = gripper
        self._why_not_now = why_not
        self._turn = turn
        self._calibrate_hand = calibrate
        triggers: Mapping[str, Action] = {
            "calibrate": lambda: self._moving(self._calibrate),
            "jog_open": lambda: self._moving(partial(self._jog, opens=True)),
            "jog_close": lambda: self._moving(partial(self._jog, opens=False)),
            "stop": self._stop,
            "clear_error": self._clear_error,
        }
        for name, action in triggers.items():
            node.create_service(Trigger, f"~/{name}", partial(self._trigger, name, action), callback_group=group)
        for channel in CHANNELS:
            for name, switch in (("vacuum", self._switch_vacuum), ("blow", self._switch_blow)):
                full = f"{name}_{channel}"
                callback = partial(self._set, full, partial(switch, channel))
                node.create_service(SetBool, f"~/{full}", callback, callback_group=group)

    def _trigger(self, name: str, action: Action, _: Any, response: Any) -> Any:
        return self._answer(name, action, response)

    def _set(self, name: str, action: Callable[[bool], str], request: Any, response: Any) -> Any:
        return self._answer(name, lambda: action(bool(request.data)), response)

    def _answer(self, name: str, action: Action, response: Any) -> Any:
        try:
            response.message, response.success = action(), True
        except YumiError as error:
            self._log.error(f"{name}: {error}")
            response.message, response.success = str(error), False
        return response

    def _moving(self, action: Action) -> str:
        """Carry out what moves the fingers, unless something else does."""
        self._check()
        if not self._turn.take():
            raise CommandRefused("A goal is being carried out; wait for its result, or cancel it.")
        try:
            return action()
        finally:
            self._turn.give_back()

    def _check(self) -> None:
        reason = self._why_not_now()
        if reason is not None:
            raise RobotNotReady(reason)

    def _calibrate(self) -> str:
        self._calibrate_hand(self._gripper)
        return "The gripper is calibrated: closed is 0."

    def _jog(self, *, opens: bool) -> str:
        self._gripper.jog(opens=opens, check=self._check)
        return f"The fingers {'open' if opens else 'close'} until stop is called."

    def _stop(self) -> str:
        self._gripper.stop()
        return "The fingers stand; what they held is free."

    def _clear_error(self) -> str:
        self._gripper.clear_error()
        return "The gripper reports no error."

    def _switch_vacuum(self, channel: int, is_on: bool) -> str:
        self._gripper.vacuum.check(channel)
        self._check()
        self._gripper.vacuum.switch(channel, is_on=is_on)
        return f"Vacuum {channel} is {'on' if is_on else 'off'}."

    def _switch_blow(self, channel: int, is_on: bool) -> str:
        self._gripper.vacuum.check(channel)
        self._check()
        self._gripper.vacuum.blow(channel, is_on=is_on)
        return f"Blow-off {channel} is {'on' if is_on else 'off'}."
