"""The page that operates the robot: what it asks for, its jogs and its plans, over its own connection to the driver.

A motion is planned in a process of its own, since a search takes all of a processor for seconds.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NamedTuple

import msgspec

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, RobotNotReady, YumiError
from abb_protocols.robot.description import FINGERTIPS
from abb_protocols.robot.differential_kinematics import DifferentialSolver, target_error, wrist_of, wrist_target
from abb_protocols.robot.joints import JOINT_COUNT, Joints, Pose, Side, by_side, rotate
from abb_protocols.robot.kinematics import compose_poses, inverse_pose, quaternion_of, quaternion_product, tool0_to_body
from abb_runtime.faults import inject_fault, takes_faults
from yumi.api.joint_positions import checked_goal
from yumi.driver.command import Command, SentPosition
from yumi.driver.commands import SwitchControllers
from yumi.driver.controller_names import CARTESIAN_CONTROLLER, JOG_CONTROLLER
from yumi.driver.motion_commands import Follow
from yumi.driver.reports import MotionReport
from yumi.driver.surroundings import limits_of, shapes_of
from yumi.web.driver_link import DriverLink
from yumi.web.live import JoggedArm, LiveRobot
from yumi.web.page_device import PageDevice
from yumi.web.page_messages import (
    MAX_JOG_JOINT_SPEED,
    AnyJog,
    Ask,
    DeviceMessage,
    ExecutePlan,
    ForOperator,
    Inject,
    JointsJog,
    PlanMotion,
    ToolJog,
)
from yumi.web.page_words import failure_for_page, words_for_page

if TYPE_CHECKING:
    from yumi.planning.planner import Plan
    from yumi.planning.planning_process import PlanningProcess

_PLANNED_SPEED_SCALE = 0.5
"""Share of the joints' speeds that a page plans for, before speed_scale."""

_PLANNING_TIMEOUT = 20.0  # [s] for one plan

OLDEST_SEEN_STATE = 0.8
"""A page that was shown no state since this time jogs nothing [s]: its messages may come late, and all at once.

More than for frames of a device: the age of these is read from two clocks, which takes messages before. The first jog
of a page has none before it, only the newest state, which a page that draws in software shows late. From here on the
clock is that of the driver, which takes no jog of a joint or of a tool that came here longer than
:data:`yumi.api.streams.OLDEST_JOG` ago: as long as their controllers take a velocity for new."""

STALE_JOG = 0.05
"""A jog that has waited here for longer is not carried out, but its end is [s]."""

_PLAN_POINTS = 120  # points of a plan that the page gets, about
_LAST_ANSWER = 0.3  # [s] the driver has for the end of a jog, before its connection is closed
_JUST_NOW = 0.5  # [s] so long ago an arm may have been jogged that moves

_Send = Callable[[dict[str, Any]], None]
"""Sends a message to a page; ``type`` says of what kind."""

_Show = Callable[[Mapping[str, Any]], None]
"""Sends a message of which a page gets the newest only."""


class _ReceivedJog(NamedTuple):
    """The newest jog message and when it came, on the monotonic clock [s]."""

    jog: AnyJog
    time: float


class Operator:
    """The one page that operates the robot, from when it has taken control until it gives it back or loses it.

    What it asks for goes over a connection of its own to the driver: when that is closed, the driver stops what moves.

    Args:
        live: the robot.
        send: sends to the page.
        show: sends what became of a frame of the page's device, of which the newest counts.
        planning: plans motions.
    """

    def __init__(self, live: LiveRobot, send: _Send, show: _Show, planning: PlanningProcess) -> None:
        self._live, self._send, self._planning = live, send, planning
        self._plans = 0
        self._plan: Plan | None = None  # the one that the page shows
        self._link: DriverLink | None = None
        self._newest_jog: _ReceivedJog | None = None
        self._has_jog = asyncio.Event()
        self._device = PageDevice(
            self._ask, show, self._failure, lambda said: words_for_page(said.message, is_virtual=live.is_virtual)
        )
        self._following: tuple[asyncio.Task[None], ...] = ()  # of what is repeated: jogs, and frames of the device
        self._tasks: set[asyncio.Task[None]] = set()
        self._refused = -1  # the hold that was refused: its further messages are left aside

    async def open(self) -> None:
        """Connect to the driver; raises RobotNotReady where none runs."""
        self._link = await DriverLink.open(self._live.robot, is_page=True)
        self._following = asyncio.create_task(self._jog_on()), asyncio.create_task(self._device.run())

    async def close(self) -> None:
        """Stop what moves for this page; the arms hold then."""
        link, self._link = self._link, None
        for task in (*self._following, *self._tasks):
            task.cancel()
        if link is None:
            return
        try:
            if self._newest_jog is not None and time.monotonic() - self._newest_jog.time < _JUST_NOW:
                with suppress(YumiError, asyncio.TimeoutError):  # at once; without it the driver does so a moment later
                    await asyncio.wait_for(link.ask(self._newest_jog.jog.at_rest), _LAST_ANSWER)
        finally:
            await link.close()

    def take(self, message: ForOperator) -> None:
        """Begin what the page asks for; it gets steps and end under the number of its message."""
        if isinstance(message, JointsJog | ToolJog):
            self._take_jog(message)
        elif isinstance(message, DeviceMessage):
            self._device.take(message)
        elif isinstance(message, Ask):
            if isinstance(message.request, SwitchControllers):
                self._live.jogged.pop(message.request.arm, None)  # what was active before a jog is not wanted again
            self._begin(message.id, self.carry_out, message.id, message.request)
        elif isinstance(message, Inject):
            self._begin(message.id, self._inject, message)
        elif isinstance(message, PlanMotion):
            self._begin(message.id, self._make_plan, message)
        else:
            self._execute(message)

    def _take_jog(self, jog: AnyJog) -> None:
        """Take a jog message: the newest one counts, unless the page sent it so long ago that it stands no more."""
        now = time.monotonic()
        if not now - jog.seen <= OLDEST_SEEN_STATE and jog.request != jog.at_rest:
            self._refuse_jog(jog.hold, CommandRefused(message("page_too_slow_to_jog")))
            return
        self._newest_jog = _ReceivedJog(jog, now)
        self._has_jog.set()

    def _refuse_jog(self, hold: int, error: Exception) -> None:
        if hold != self._refused:
            self._refused = hold
            self._send({"type": "jog_refused", "hold": hold, "error": self._failure(error)})

    def _execute(self, request: ExecutePlan) -> None:
        """Have the arms follow the plan that the page shows."""
        plan = self._plan if request.plan == self._plans else None
        if plan is None:
            self._fail(request.id, CommandRefused(message("plan_is_old")))
            return
        self._plan = None
        ways = {side.word: tuple(tuple(point) for point in points) for side, points in plan.points.items()}
        start = {side.word: position for side, position in plan.start.items()}
        order = msgspec.convert({"method": "follow", "start": start, **ways}, Follow)
        self._begin(request.id, self.carry_out, request.id, order)

    def _begin(self, number: int, call: Callable[..., Awaitable[object]], *arguments: Any) -> None:
        task = asyncio.create_task(self.answer(number, call, *arguments))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _fail(self, number: int, error: Exception) -> None:
        self._send({"type": "failed", "id": number, "error": self._failure(error)})

    def _failure(self, error: Exception) -> Mapping[str, object]:
        return failure_for_page(error, is_virtual=self._live.is_virtual)

    async def answer(self, number: int, call: Callable[..., Awaitable[object]], *arguments: Any) -> None:
        """Do something for the page, which gets the result or the failure under ``number``."""
        try:
            self._send({"type": "done", "id": number, "result": await call(*arguments)})
        except Exception as error:
            self._fail(number, error)

    async def carry_out(self, number: int, command: Command[Any]) -> msgspec.Raw:
        """Have the driver carry out a command; the page gets its steps under ``number``."""

        def on_step(step: str) -> None:
            self._send({"type": "step", "id": number, "step": step})

        def on_motion(motions: dict[str, MotionReport]) -> None:
            self._send({"type": "motions", "id": number, "motions": motions})

        return await self._ask(command, on_step, on_motion)

    async def _ask(self, command: Command[Any], *reports: Callable[[Any], None]) -> msgspec.Raw:
        if self._link is None:
            raise RobotNotReady(message("control_given_back"))
        return await self._link.ask(command, *reports)

    async def _make_plan(self, request: PlanMotion) -> dict[str, object]:
        self._plan = None
        start = self._live.state().planning_start()
        goals: dict[Side, Joints | Pose] = {}
        asked: Mapping[Side, SentPosition] = by_side(request.right, request.left)
        for side, goal in asked.items():
            if not request.is_pose:
                goals[side] = checked_goal(side, goal, start[side])
                continue
            if not isinstance(goal, tuple) or len(goal) != JOINT_COUNT:
                raise CommandRefused(message("no_pose_of_fingertips"))
            goals[side] = compose_poses(Pose(goal[:3], goal[3:]), inverse_pose(FINGERTIPS))  # type: ignore[arg-type]
        surroundings = self._live.surroundings
        grippers, tools, obstacles = shapes_of(surroundings)
        plan = await self._planning.plan(
            start,
            goals,
            timeout=_PLANNING_TIMEOUT,
            speed_scale=_PLANNED_SPEED_SCALE,
            grippers=grippers,
            tools=tools,
            obstacles=obstacles,
            limits=limits_of(surroundings),
        )
        self._plans += 1
        self._plan = plan
        shown = {
            side.word: [
                [round(point.time, 3), [round(value, 4) for value in point.position]]
                for point in (*points[: -1 : max(1, len(points) // _PLAN_POINTS)], points[-1])
            ]
            for side, points in plan.points.items()
        }
        return {
            "plan": self._plans,
            "duration": plan.duration,
            "planning_time": plan.planning_time,
            "clearance": plan.clearance,
            "arms": shown,
        }

    async def _inject(self, request: Inject) -> str:
        address = self._live.address
        # Asked before each, since another controller may answer by now.
        if not self._live.is_virtual or not await asyncio.to_thread(takes_faults, address):
            raise CommandRefused(message("faults_only_virtual"))
        fault = await asyncio.to_thread(inject_fault, address, request.name, request.form)
        return f"Done: {fault.value.meaning}"

    async def _jog_on(self) -> None:
        """Carry out the newest jog message again and again; one request to the driver is under way at a time."""
        while True:
            await self._has_jog.wait()
            self._has_jog.clear()
            received = self._newest_jog
            if received is None or self._link is None or received.jog.hold == self._refused:
                continue
            jog = received.jog
            if time.monotonic() - received.time > STALE_JOG and jog.request != jog.at_rest:
                continue  # the end of a jog is never too late
            try:
                state = self._live.state()
                leading = tuple(each.name for each in state.controllers[jog.arm] if each.commands)
                known = self._live.jogged.get(jog.arm)
                if known is None or not leading or not known.by.issuperset(leading):  # jogged anew
                    known = JoggedArm(leading, frozenset())
                own = JOG_CONTROLLER if isinstance(jog, JointsJog) else CARTESIAN_CONTROLLER
                self._live.jogged[jog.arm] = known._replace(by=known.by | {own})
                if isinstance(jog, ToolJog) and (position := state.arms[jog.arm].position) is not None:
                    jog = within_joint_speed(jog, position)
                await self._link.ask(msgspec.structs.replace(jog.request, time=received.time))
            except Exception as error:  # a fault of ours, too: a page must not hold a key in vain
                self._refuse_jog(jog.hold, error)


def within_joint_speed(jog: ToolJog, position: Joints) -> ToolJog:
    """The same jog, as slow as it takes for no joint to be faster than joints are jogged, from a position [rad], (7,).

    An arm that is stretched turns quickly for a tool that goes slowly, and would not stand in time when a page is lost.
    """
    side, step = Side[jog.arm.upper()], 1e-3  # [s]
    now, tip = wrist_of(side, position), tool0_to_body(side, position, FINGERTIPS)
    linear, angular = jog.linear, jog.angular
    if jog.frame == "tool":
        linear, angular = rotate(tip.orientation, linear), rotate(tip.orientation, angular)
    x, y, z = (place + step * speed for place, speed in zip(tip.position, linear, strict=True))
    after = Pose((x, y, z), quaternion_product(quaternion_of(angular, step), tip.orientation))
    target = wrist_target(side, compose_poses(after, inverse_pose(FINGERTIPS)), now.angle + step * jog.elbow)
    fastest = max(map(abs, DifferentialSolver(now).change(target_error(now, target)))) / step
    share = min(1.0, MAX_JOG_JOINT_SPEED / max(fastest, 1e-9))
    (a, b, c), (d, e, f) = jog.linear, jog.angular
    return msgspec.structs.replace(
        jog,
        linear=(share * a, share * b, share * c),
        angular=(share * d, share * e, share * f),
        elbow=share * jog.elbow,
    )
