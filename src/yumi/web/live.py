"""A running robot for the pages: one subscription to its driver for all of them, and one page that operates it."""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from ipaddress import ip_address
from typing import Annotated, Any, Literal, NamedTuple

import aiohttp
import msgspec

from yumi.api.motion import CARTESIAN_CONTROLLER, JOG_CONTROLLER
from yumi.driver import endpoint as wire
from yumi.driver.endpoint import (
    Arm,
    DriverState,
    EventReport,
    Failure,
    GetState,
    Jog,
    MotionReport,
    Request,
    SwitchControllers,
    failure_of,
)
from yumi.errors import CommandRefused, RobotNotReady, YumiError
from yumi.robot.joints import ZERO
from yumi.virtual.process import inject_fault
from yumi.web.link import DriverLink

RATE = 30.0
"""A page gets the state so often [1/s]."""

MAX_JOINT_SPEED = 1.0
"""No joint is jogged faster than this [rad/s], before speed_scale."""

MAX_LINEAR, MAX_ANGULAR = 0.2, 1.0
"""The tool is not jogged faster than this [m/s], [rad/s], before speed_scale."""

STALE = 0.15
"""A jog that a page has sent longer ago is not carried out [s]."""

log = logging.getLogger(__name__)

_LOOKED_FOR = "The driver is being looked for."
_EVENTS = 200  # of the driver's log that a new page gets
_SEARCH = 1.0  # [s] between two attempts to find a driver
_STAND = 3.0  # [s] after its end a jogged arm stands
_POLL = 0.05  # [s]
_LAST_ANSWER = 0.3  # [s] the driver has for the end of a jog, before its connection is closed
_JUST_NOW = 0.5  # [s] so long ago an arm may have been jogged that moves

_Speed = Annotated[float, msgspec.Meta(ge=-MAX_JOINT_SPEED, le=MAX_JOINT_SPEED)]
_Linear = Annotated[float, msgspec.Meta(ge=-MAX_LINEAR, le=MAX_LINEAR)]
_Angular = Annotated[float, msgspec.Meta(ge=-MAX_ANGULAR, le=MAX_ANGULAR)]


class JogJoints(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="type", tag="jog_joints"
):
    """A key is held: joint speeds of an arm [rad/s]; zeros when it is released. ``hold`` counts the holds."""

    arm: Arm
    hold: int
    speeds: tuple[_Speed, _Speed, _Speed, _Speed, _Speed, _Speed, _Speed]

    @property
    def request(self) -> Request:
        """What the driver is asked for."""
        return Jog(arm=self.arm, speeds=self.speeds)

    @property
    def at_rest(self) -> Request:
        """The same without motion."""
        return Jog(arm=self.arm, speeds=ZERO)


class JogTool(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="type", tag="jog_tool"):
    """A key is held: speeds of the tool [m/s], [rad/s] in a frame, or of the elbow [rad/s]."""

    arm: Arm
    hold: int
    frame: Literal["base", "tool"] = "base"
    linear: tuple[_Linear, _Linear, _Linear] = (0.0, 0.0, 0.0)
    angular: tuple[_Angular, _Angular, _Angular] = (0.0, 0.0, 0.0)
    elbow: _Speed = 0.0

    @property
    def request(self) -> Request:
        """What the driver is asked for."""
        return wire.JogTool(arm=self.arm, linear=self.linear, angular=self.angular, elbow=self.elbow, frame=self.frame)

    @property
    def at_rest(self) -> Request:
        """The same without motion."""
        return wire.JogTool(arm=self.arm, frame=self.frame)


AnyJog = JogJoints | JogTool
Send = Callable[[dict[str, Any]], None]
"""Sends a message to a page; ``type`` says of what kind."""


class StateMessage(msgspec.Struct, frozen=True, tag_field="type", tag="state"):
    """The state as the driver wrote it, with the events since the one before."""

    state: msgspec.Raw
    events: tuple[EventReport, ...]


class LiveRobot:
    """The robot of a running driver, which is looked for again and again; watched only while a page is open.

    Args:
        robot: its address or namespace, where several drivers run.
        on_state: called with each state, as JSON.
        on_change: called when a driver was found or lost.

    Attributes:
        why_not: why there is no state; empty while there is one.
        address: of the robot; empty while it is unknown.
        is_virtual: whether it is a virtual one on this machine.
        events: the newest lines of the driver's log.
    """

    def __init__(self, robot: str, on_state: Callable[[bytes], None], on_change: Callable[[], None]) -> None:
        self.robot = robot
        self.why_not = _LOOKED_FOR
        self.address, self.is_virtual = "", False
        self.events: deque[EventReport] = deque(maxlen=_EVENTS)
        self._on_state, self._on_change = on_state, on_change
        self._state: tuple[float, msgspec.Raw] | None = None
        self._watched = asyncio.Event()

    def watch(self, is_watched: bool) -> None:
        """Whether a page is open."""
        if is_watched:
            self._watched.set()
        else:
            self._watched.clear()

    def state(self) -> DriverState:
        """The newest state.

        Raises:
            RobotNotReady: there is none, or it is old.
        """
        if self._state is None or time.monotonic() - self._state[0] > 1.0:
            raise RobotNotReady(self.why_not or "The driver has sent no state for a second.")
        return msgspec.json.decode(self._state[1], type=DriverState)

    async def run(self) -> None:
        """Find the driver and watch it, until cancelled."""
        while True:
            await self._watched.wait()
            try:
                link = await DriverLink.open(self.robot)
                try:
                    await self._follow(link)
                finally:
                    await link.close()
            except Exception as error:
                sentence, self.is_virtual = _failure(error).message, False
                if sentence != self.why_not:
                    self.why_not, self._state = sentence, None
                    self._on_change()
                await asyncio.sleep(_SEARCH)

    async def _follow(self, link: DriverLink) -> None:
        self.events.clear()
        async for raw, events in link.states(RATE):
            is_new = self._state is None
            self._state = time.monotonic(), raw
            self.events.extend(events)
            if is_new:
                self.address = self.state().robot
                self.is_virtual = await _is_virtual(self.address)
                self.why_not = ""
                self._on_change()
            self._on_state(msgspec.json.encode(StateMessage(raw, events)))
            if not self._watched.is_set():
                self._state, self.why_not, self.is_virtual = None, _LOOKED_FOR, False  # another one may run later
                return


async def _is_virtual(address: str) -> bool:
    """Whether the controller is a virtual one on this machine: only that one has faults to inject."""
    host = address.rpartition(":")[0]
    try:
        if not (host == "localhost" or ip_address(host).is_loopback):
            return False
        timeout = aiohttp.ClientTimeout(total=2.0)
        async with (
            aiohttp.ClientSession(timeout=timeout) as session,
            session.get(f"http://{address}/virtual/faults") as reply,
        ):
            return reply.status == 200 and reply.content_type == "application/json"
    except (aiohttp.ClientError, asyncio.TimeoutError, ValueError, OSError):
        return False


class _Held(NamedTuple):
    """The newest jog message and when it came, on the monotonic clock [s]."""

    jog: AnyJog
    time: float


class Operator:
    """The one page that operates the robot, from when it has taken control until it gives it back or loses it.

    What it asks for goes over a connection of its own to the driver: when that is closed, the driver stops what moves.

    Args:
        live: the robot.
        send: sends to the page.
    """

    def __init__(self, live: LiveRobot, send: Send) -> None:
        self._live, self._send = live, send
        self._link: DriverLink | None = None
        self._held: _Held | None = None
        self._is_held = asyncio.Event()
        self._jogging: asyncio.Task[None] | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        self._before: dict[Arm, tuple[str, ...]] = {}  # controllers that commanded the arms before they were jogged

    async def open(self) -> None:
        """Connect to the driver; raises RobotNotReady where none runs."""
        self._link = await DriverLink.open(self._live.robot)
        self._jogging = asyncio.create_task(self._jog_on())

    async def close(self, *, gives_back: bool = False) -> None:
        """Stop what moves for this page; the arms hold then.

        With ``gives_back`` the controllers that commanded them do so again, which may move them: a person must want it.
        """
        link, self._link = self._link, None
        if self._jogging is not None:
            self._jogging.cancel()
        for task in tuple(self._tasks):
            task.cancel()
        if link is None:
            return
        try:
            if self._held is not None and time.monotonic() - self._held.time < _JUST_NOW:
                with suppress(YumiError, asyncio.TimeoutError):  # at once; without it the arm stops 0.1 s later
                    await asyncio.wait_for(link.ask(self._held.jog.at_rest), _LAST_ANSWER)
        finally:
            await link.close()
        if gives_back and self._before:
            with suppress(YumiError):  # the driver has ended, or EGM has: no controller commands there
                await _give_back(self._live, self._before)

    def ask(self, number: int, request: Request) -> None:
        """Have the driver carry out a request; the page gets its steps and its end under ``number``."""
        if isinstance(request, SwitchControllers):
            self._before.pop(request.arm, None)  # what was active before a jog is not wanted again
        task = asyncio.create_task(self.carry_out(number, request))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def jog(self, jog: AnyJog) -> None:
        """Take a jog message: the newest one counts."""
        self._held = _Held(jog, time.monotonic())
        self._is_held.set()

    def inject(self, number: int, name: str, form: dict[str, str]) -> None:
        """Inject a fault into a virtual robot."""
        task = asyncio.create_task(self._inject(number, name, form))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def carry_out(self, number: int, request: Request) -> None:
        """Have the driver carry out a request, and wait for its end."""

        def on_step(step: str) -> None:
            self._send({"type": "step", "id": number, "step": step})

        def on_motion(motions: dict[str, MotionReport]) -> None:
            self._send({"type": "motions", "id": number, "motions": motions})

        try:
            if self._link is None:
                raise RobotNotReady("Control was given back before this was asked for.")
            result = await self._link.ask(request, on_step, on_motion)
            self._send({"type": "done", "id": number, "result": result})
        except Exception as error:
            self._send({"type": "failed", "id": number, "error": _failure(error)})

    async def _inject(self, number: int, name: str, form: dict[str, str]) -> None:
        try:
            if not self._live.is_virtual:
                raise CommandRefused("Only a virtual robot takes faults.")
            await asyncio.to_thread(inject_fault, self._live.address, name, form)
            self._send({"type": "done", "id": number, "result": f"{name}: done"})
        except Exception as error:
            self._send({"type": "failed", "id": number, "error": _failure(error)})

    async def _jog_on(self) -> None:
        """Carry out the newest jog message again and again; one request to the driver is under way at a time."""
        refused = -1  # the hold that was refused: its further messages are left aside
        while True:
            await self._is_held.wait()
            self._is_held.clear()
            held = self._held
            if held is None or self._link is None or held.jog.hold == refused:
                continue
            if time.monotonic() - held.time > STALE:
                continue
            arm = held.jog.arm
            try:
                state = self._live.state()
                if arm not in self._before:
                    self._before[arm] = tuple(each.name for each in state.controllers[arm] if each.commands)
                await self._link.ask(held.jog.request)
            except Exception as error:  # a fault of ours, too: a page must not hold a key in vain
                refused = held.jog.hold
                self._send({"type": "jog_refused", "hold": refused, "error": _failure(error)})


def _failure(error: Exception) -> Failure:
    """What a page gets of an exception; what is no refusal is a fault of ours, which the log shows whole."""
    if isinstance(error, YumiError):
        return failure_of(error)
    log.error("What a page has asked for failed with %s: %s", type(error).__name__, error, exc_info=error)
    return failure_of(CommandRefused(f"yumi view failed with {type(error).__name__}: {error}; its output says more."))


async def _give_back(live: LiveRobot, before: dict[Arm, tuple[str, ...]]) -> None:
    """Have the controllers command the arms again that did so before a jog, once the arms stand."""
    link = await DriverLink.open(live.robot)
    try:
        for arm, names in before.items():
            for _ in range(round(_STAND / _POLL)):
                raw = await link.ask(GetState())
                state = msgspec.json.decode(raw, type=DriverState)
                if state.arms[arm].mode.value != "moving":
                    break
                await asyncio.sleep(_POLL)
            now = tuple(each.name for each in state.controllers[arm] if each.commands)
            is_jogged = now in ((JOG_CONTROLLER,), (CARTESIAN_CONTROLLER,))
            if names and is_jogged and now != names and state.arms[arm].mode.value == "holding":
                await link.ask(SwitchControllers(arm=arm, activate=names, deactivate=now))
    finally:
        await link.close()
