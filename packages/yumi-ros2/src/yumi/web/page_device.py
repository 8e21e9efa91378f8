"""The device with which the person at the page teleoperates: its newest frame goes to the driver, one at a time."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable, Mapping
from typing import Any

import msgspec

from yumi.driver.device_frame import DeviceFrame, TeleoperationReport
from yumi.driver.motion_commands import Teleoperate
from yumi.driver.reports import Said
from yumi.web.page_messages import DeviceMessage

_MOST_WAITING = 4
"""Frames in which a clutch was let go or pressed again; with more, the oldest is left out."""

_report_decoder = msgspec.json.Decoder(TeleoperationReport)


class PageDevice:
    """The device of the page that operates.

    When no frame comes any more, the driver brakes the arms, and their clutches must be pressed again.

    Args:
        ask: has the driver take a frame; its answer.
        show: takes what the page gets of each answer, of which the newest counts.
        failure: an exception in the page's words.
        words: what is said, in the page's words.
    """

    def __init__(
        self,
        ask: Callable[[Teleoperate], Awaitable[msgspec.Raw]],
        show: Callable[[Mapping[str, Any]], None],
        failure: Callable[[Exception], Mapping[str, object]],
        words: Callable[[Said], Mapping[str, object]],
    ) -> None:
        self._ask, self._show, self._failure, self._words = ask, show, failure, words
        self._waiting: deque[DeviceMessage] = deque(maxlen=_MOST_WAITING)
        self._has_frame = asyncio.Event()

    def take(self, device: DeviceMessage) -> None:
        """Take a frame, in place of one that waits, but where a clutch was let go in that and is pressed again in this.

        The driver must see that it was let go: the arm goes on from where it is then, not to where the hand has gone.
        """
        if self._waiting and not _is_pressed_anew(self._waiting[-1].frame, device.frame):
            self._waiting.pop()
        self._waiting.append(device)
        self._has_frame.set()

    async def run(self) -> None:
        """Have the driver take the newest frame again and again, until cancelled."""
        while True:
            await self._has_frame.wait()
            device = self._waiting.popleft()
            if not self._waiting:
                self._has_frame.clear()
            try:
                answer = await self._ask(Teleoperate(frame=device.frame, is_headset=device.is_headset))
                self._show(self._shown(device.frame.time, _report_decoder.decode(answer)))
            except Exception as error:  # a fault of ours, too: a page must not hold a clutch in vain
                self._show(refused_report(device, self._failure(error)))

    def _shown(self, time: float, report: TeleoperationReport) -> Mapping[str, Any]:
        def said(what: Said | None) -> Mapping[str, object] | None:
            return None if what is None else self._words(what)

        arms = {
            side.word: {
                "clutch": arm.clutch,
                "why": said(arm.why),
                "limited": arm.limited,
                "gripper": said(arm.gripper),
            }
            for side, arm in report.arms.items()
        }
        return {"type": "teleoperated", "time": time, "dropped": report.dropped, "arms": arms, "error": None}


def _is_pressed_anew(before: DeviceFrame, after: DeviceFrame) -> bool:
    return any(hand.clutch and not before.by_arm[side].clutch for side, hand in after.by_arm.items())


def refused_report(device: DeviceMessage, failure: Mapping[str, object]) -> Mapping[str, Any]:
    """What the page gets of a frame that is refused."""
    return {"type": "teleoperated", "time": device.frame.time, "dropped": 0, "arms": {}, "error": failure}
