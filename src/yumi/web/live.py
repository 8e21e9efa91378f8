"""A running robot for the pages of ``yumi view``: one subscription to its driver for all of them, one page operates it.

A page sends a :class:`PageMessage`; anything else is refused. With the driver's state it gets the two parts that are
nearest to each other, and a motion that it plans is planned in a process of its own, since a search takes all of a
processor for seconds. The driver is reached over its local endpoint, by a client for asyncio.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from collections.abc import AsyncIterator, Callable, Collection, Coroutine, Iterable, Mapping
from contextlib import suppress
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import msgspec

from yumi.api.arm_access import CARTESIAN_CONTROLLER, JOG_CONTROLLER
from yumi.api.connection import limits_of, shapes_of
from yumi.api.joint_positions import checked_goal
from yumi.catalogue import FrontEnd, Message, message, said_by, sentence
from yumi.control.shared_state import Limited
from yumi.driver.endpoint import (
    ANSWER,
    Answer,
    Arm,
    Attach,
    Calibrate,
    DriverState,
    EventReport,
    Follow,
    GetState,
    GetSurroundings,
    Grip,
    Jog,
    JogTool,
    MotionReport,
    Move,
    Position,
    Recover,
    Request,
    Said,
    SetSpeedScale,
    StartEgm,
    StopEgm,
    Subscribe,
    Surroundings,
    SwitchControllers,
    error_of,
    find_driver,
)
from yumi.egm.udp import is_loopback
from yumi.errors import CommandRefused, RobotNotReady, YumiError
from yumi.robot.collision import BODY, CollisionModel, Distance
from yumi.robot.description import FINGERTIPS
from yumi.robot.differential_kinematics import DifferentialSolver, target_error, wrist_of, wrist_target
from yumi.robot.joints import JOINT_COUNT, ZERO, Joints, Pose, Side, rotate
from yumi.robot.kinematics import compose, inverse, multiply, quaternion_of, tool0_to_body
from yumi.virtual.faults import fault_named, inject_fault

if TYPE_CHECKING:
    from yumi.planning.planner import Plan
    from yumi.planning.planning_process import PlanningProcess

log = logging.getLogger(__name__)

RATE = 30.0
"""A page gets the state so often [1/s]."""

STALE = 0.05
"""A jog that has waited here for longer is not carried out, but its end is [s]."""

OLDEST_SEEN = 0.8
"""A page that was shown no state since this time jogs nothing [s]: its messages may come late, and all at once."""

_LOOKED_FOR = message("driver_looked_for")
_STATES_PER_DISTANCE = 3
_SHOWN_FOR = 0.5  # [s] what limited an arm is shown for so long: several parts may do so in turn
_PLAN_POINTS = 120  # points of a plan that the page gets, about
_EVENTS = 200  # of the driver's log that a new page gets
_SEARCH = 1.0  # [s] between two attempts to find a driver
_STAND = 3.0  # [s] after its end a jogged arm stands
_POLL = 0.05  # [s]
_LAST_ANSWER = 0.3  # [s] the driver has for the end of a jog, before its connection is closed
_JUST_NOW = 0.5  # [s] so long ago an arm may have been jogged that moves

Send = Callable[[dict[str, Any]], None]
"""Sends a message to a page; ``type`` says of what kind."""


class StateMessage(msgspec.Struct, frozen=True, tag_field="type", tag="state"):
    """The state as the driver wrote it; of several states a slow page gets the newest one only.

    ``time`` is when it came, on this machine's monotonic clock [s]; ``reasons`` and ``causes`` are those of the state,
    and ``problems`` those of its arms, in the page's words, see :func:`words_for_page`; ``stop`` is the id of the stop
    that is to be confirmed; ``limited`` are the arms that something limits, as :class:`ShownLimits` has it; ``nearest``
    are two parts of these, else those nearest of all.
    """

    time: float
    state: msgspec.Raw
    reasons: tuple[Mapping[str, object], ...]
    causes: tuple[Mapping[str, object], ...]
    stop: str
    problems: dict[str, Mapping[str, object]]
    limited: dict[str, Limited]
    nearest: Distance | None


class _ArmPart(msgspec.Struct, frozen=True):
    position: Joints | None
    problem: Said | None
    limited: Limited | None = None


class _StatePart(msgspec.Struct, frozen=True):
    """What is needed of a state for distances and words."""

    arms: dict[str, _ArmPart]
    reasons: tuple[Said, ...]
    causes: tuple[Said, ...]
    stop: str


class ShownLimits:
    """What limits each arm, so that a person can read it: the same parts for as long as they do so now and again."""

    def __init__(self) -> None:
        self._shown: dict[str, tuple[Limited, float]] = {}  # and when it was last so [s]

    def update(self, limited: Mapping[str, Limited | None], now: float) -> dict[str, Limited]:
        """What to show of the arms at ``now`` [s]."""
        for arm, newest in limited.items():
            last, since = self._shown.get(arm, (None, -inf))
            is_same = last is not None and newest is not None and (last.part, last.other) == (newest.part, newest.other)
            if newest is not None and (is_same or now - since > _SHOWN_FOR):
                self._shown[arm] = newest, now
            elif last is not None and now - since > _SHOWN_FOR:
                del self._shown[arm]
        return {arm: last for arm, (last, _) in self._shown.items()}


class Jogged(NamedTuple):
    """An arm that pages have jogged: the controllers that commanded it before, and those that pages jogged it with."""

    before: tuple[str, ...]
    by: frozenset[str]


class LiveRobot:
    """The robot of a running driver, which is looked for again and again; watched only while a page is open.

    Args:
        robot: its address or namespace, where several drivers run.
        on_state: called with each state, as JSON.
        on_events: called with new lines of the driver's log.
        on_change: called when a driver was found or lost.

    Attributes:
        why_not: why there is no state; None while there is one.
        address: of the robot; empty while it is unknown.
        is_virtual: whether it is a virtual one on this machine.
        events: the newest lines of the driver's log.
        surroundings: what must not collide, as the driver declares it.
        jogged: the arms that pages have jogged since their controllers were switched otherwise.
    """

    def __init__(
        self,
        robot: str,
        on_state: Callable[[bytes], None],
        on_events: Callable[[tuple[EventReport, ...]], None],
        on_change: Callable[[], None],
    ) -> None:
        self.robot = robot
        self.why_not: Message | None = _LOOKED_FOR
        self.address, self.is_virtual = "", False
        self.events: deque[EventReport] = deque(maxlen=_EVENTS)
        self.surroundings = Surroundings()
        self.jogged: dict[Arm, Jogged] = {}
        self._on_state, self._on_events, self._on_change = on_state, on_events, on_change
        self._state: tuple[float, msgspec.Raw] | None = None
        self._watched = asyncio.Event()

    def watch(self, is_watched: bool) -> None:
        """Whether a page is open."""
        if is_watched:
            self._watched.set()
        else:
            self._watched.clear()
            self.jogged.clear()  # what others do to the arms from now on is not seen

    def state(self) -> DriverState:
        """The newest state.

        Raises:
            RobotNotReady: there is none, or it is old.
        """
        if self._state is None or time.monotonic() - self._state[0] > 1.0:
            raise RobotNotReady(self.why_not or message("driver_sent_no_state", duration=1.0))
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
                why_not, self.is_virtual = said_of(error), False
                if why_not != self.why_not:
                    self.why_not, self._state = why_not, None
                    self.jogged.clear()  # the next driver begins anew
                    self._on_change()
                await asyncio.sleep(_SEARCH)

    async def give_back(self) -> None:
        """Have the controllers command the arms again that did so before pages jogged them, once the arms stand.

        This may move them: a person must want it.
        """
        if not self.jogged:
            return
        try:
            link = await DriverLink.open(self.robot)
            try:
                for arm, (names, by) in tuple(self.jogged.items()):
                    for _ in range(round(_STAND / _POLL)):
                        raw = await link.ask(GetState())
                        state = msgspec.json.decode(raw, type=DriverState)
                        if state.arms[arm].mode.value != "moving":
                            break
                        await asyncio.sleep(_POLL)
                    now = tuple(each.name for each in state.controllers[arm] if each.commands)
                    is_jogged = bool(now) and by.issuperset(now)
                    if names and is_jogged and now != names and state.arms[arm].mode.value == "holding":
                        await link.ask(SwitchControllers(arm=arm, activate=names, deactivate=now))
                    self.jogged.pop(arm, None)
            finally:
                await link.close()
        except Exception as error:  # the driver has ended, or EGM has: no controller commands there; what is our fault
            said_of(error)  # is logged

    def _words(self, said: Said) -> Mapping[str, object]:
        return words_for_page(said.message, is_virtual=self.is_virtual)

    def words_of_events(self, events: Iterable[EventReport]) -> list[Mapping[str, object]]:
        """Lines of the driver's log in the page's words."""
        return [
            {"number": each.number, "time": each.time, "level": each.level, **self._words(each.said)} for each in events
        ]

    async def _follow(self, link: DriverLink) -> None:
        self.events.clear()
        self.surroundings = msgspec.json.decode(await link.ask(GetSurroundings()), type=Surroundings)
        distances, nearest, count = Distances(self.surroundings), None, 0
        shown, held = ShownLimits(), list[tuple[str, str]]()
        async for raw, events in link.states(RATE):
            is_new = self._state is None
            now = time.monotonic()
            self._state = now, raw
            self.events.extend(events)
            if events:
                self._on_events(events)
            if is_new:
                self.address = self.state().robot
                self.is_virtual = await _is_virtual(self.address)
                self.why_not = None
                self._on_change()
            part = msgspec.json.decode(raw, type=_StatePart)
            arms = part.arms
            limited = shown.update({arm: place.limited for arm, place in arms.items()}, now)
            before, held = held, [(it.part, it.other) for it in limited.values()]
            if count % _STATES_PER_DISTANCE == 0 or held != before:
                places = {side: arms[side.word].position for side in Side}
                positions = {side: position for side, position in places.items() if position is not None}
                nearest = distances.nearest(positions, held) if len(positions) == len(Side) else None
            count += 1
            problems = {name: self._words(arm.problem) for name, arm in arms.items() if arm.problem is not None}
            words = tuple(map(self._words, part.reasons)), tuple(map(self._words, part.causes))
            seen = StateMessage(now, raw, *words, part.stop, problems, limited, nearest)
            self._on_state(msgspec.json.encode(seen))
            if not self._watched.is_set():
                self._state, self.why_not, self.is_virtual = None, _LOOKED_FOR, False  # another one may run later
                return


async def _is_virtual(address: str) -> bool:
    """Whether the controller is a virtual one on this machine: only that one has faults to inject."""
    import aiohttp  # noqa: PLC0415 - the process that plans has no need of it

    host = address.rpartition(":")[0]
    try:
        if not is_loopback(host):
            return False
        timeout = aiohttp.ClientTimeout(total=2.0)
        async with (
            aiohttp.ClientSession(timeout=timeout) as session,
            session.get(f"http://{address}/virtual/faults") as reply,
        ):
            return reply.status == 200 and reply.content_type == "application/json"
    except (aiohttp.ClientError, asyncio.TimeoutError, ValueError, OSError):
        return False


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
        planning: plans motions.
    """

    def __init__(self, live: LiveRobot, send: Send, planning: PlanningProcess) -> None:
        self._live, self._send, self._planning = live, send, planning
        self._plans = 0
        self._plan: Plan | None = None  # the one that the page shows
        self._link: DriverLink | None = None
        self._newest_jog: _ReceivedJog | None = None
        self._has_jog = asyncio.Event()
        self._jogging: asyncio.Task[None] | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        self._refused = -1  # the hold that was refused: its further messages are left aside

    async def open(self) -> None:
        """Connect to the driver; raises RobotNotReady where none runs."""
        self._link = await DriverLink.open(self._live.robot)
        self._jogging = asyncio.create_task(self._jog_on())

    async def close(self) -> None:
        """Stop what moves for this page; the arms hold then."""
        link, self._link = self._link, None
        if self._jogging is not None:
            self._jogging.cancel()
        for task in tuple(self._tasks):
            task.cancel()
        if link is None:
            return
        try:
            if self._newest_jog is not None and time.monotonic() - self._newest_jog.time < _JUST_NOW:
                with suppress(YumiError, asyncio.TimeoutError):  # at once; without it the driver does so a moment later
                    await asyncio.wait_for(link.ask(self._newest_jog.jog.at_rest), _LAST_ANSWER)
        finally:
            await link.close()

    def take(self, message: Ask | Inject | PlanMotion | ExecutePlan | AnyJog) -> None:
        """Begin what the page asks for; it gets steps and end under the number of its message."""
        if isinstance(message, JointsJog | ToolJog):
            self._take_jog(message)
        elif isinstance(message, Ask):
            if isinstance(message.request, SwitchControllers):
                self._live.jogged.pop(message.request.arm, None)  # what was active before a jog is not wanted again
            self._begin(self.carry_out(message.id, message.request))
        elif isinstance(message, Inject):
            self._begin(self._inject(message))
        elif isinstance(message, PlanMotion):
            self._begin(self._make_plan(message))
        else:
            self._execute(message)

    def _take_jog(self, jog: AnyJog) -> None:
        """Take a jog message: the newest one counts, unless the page sent it so long ago that it stands no more."""
        now = time.monotonic()
        if not now - jog.seen <= OLDEST_SEEN and jog.request != jog.at_rest:
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
        self._begin(self.carry_out(request.id, order))

    def _begin(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _fail(self, number: int, error: Exception) -> None:
        self._send({"type": "failed", "id": number, "error": self._failure(error)})

    def _failure(self, error: Exception) -> Mapping[str, object]:
        return failure_for_page(error, is_virtual=self._live.is_virtual)

    async def carry_out(self, number: int, request: Request) -> None:
        """Have the driver carry out a request, and wait for its end."""

        def on_step(step: str) -> None:
            self._send({"type": "step", "id": number, "step": step})

        def on_motion(motions: dict[str, MotionReport]) -> None:
            self._send({"type": "motions", "id": number, "motions": motions})

        try:
            if self._link is None:
                raise RobotNotReady(message("control_given_back"))
            result = await self._link.ask(request, on_step, on_motion)
            self._send({"type": "done", "id": number, "result": result})
        except Exception as error:
            self._fail(number, error)

    async def _make_plan(self, request: PlanMotion) -> None:
        try:
            self._plan = None
            arms, start = self._live.state().arms, {}
            for side in Side:
                position = arms[side.word].position
                if position is None:
                    raise RobotNotReady(message("position_unknown_for_plan", arm=side.word))
                start[side] = position
            goals: dict[Side, Joints | Pose] = {}
            for side, goal in ((Side.RIGHT, request.right), (Side.LEFT, request.left)):
                if goal is None:
                    continue
                if not request.is_pose:
                    goals[side] = checked_goal(side, goal, start[side])
                    continue
                if not isinstance(goal, tuple) or len(goal) != JOINT_COUNT:
                    raise CommandRefused(message("no_pose_of_fingertips"))
                goals[side] = compose(Pose(goal[:3], goal[3:]), inverse(FINGERTIPS))  # type: ignore[arg-type]
            surroundings = self._live.surroundings
            grippers, tools, obstacles = shapes_of(surroundings)
            plan = await self._planning.plan(
                start,
                goals,
                timeout=_PLANNING_TIMEOUT,
                speed_scale=PLANNED_SPEED_SCALE,
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
            result = {
                "plan": self._plans,
                "duration": plan.duration,
                "planning_time": plan.planning_time,
                "clearance": plan.clearance,
                "arms": shown,
            }
            self._send({"type": "done", "id": request.id, "result": result})
        except Exception as error:
            self._fail(request.id, error)

    async def _inject(self, request: Inject) -> None:
        try:
            if not self._live.is_virtual:
                raise CommandRefused(message("faults_only_virtual"))
            await asyncio.to_thread(inject_fault, self._live.address, request.name, request.form)
            known = fault_named(request.name)
            meaning = request.name if known is None else known.value.meaning
            self._send({"type": "done", "id": request.id, "result": f"Done: {meaning}"})
        except Exception as error:
            self._fail(request.id, error)

    async def _jog_on(self) -> None:
        """Carry out the newest jog message again and again; one request to the driver is under way at a time."""
        while True:
            await self._has_jog.wait()
            self._has_jog.clear()
            received = self._newest_jog
            if received is None or self._link is None or received.jog.hold == self._refused:
                continue
            jog = received.jog
            if time.monotonic() - received.time > STALE and jog.request != jog.at_rest:
                continue  # the end of a jog is never too late
            try:
                state = self._live.state()
                leading = tuple(each.name for each in state.controllers[jog.arm] if each.commands)
                known = self._live.jogged.get(jog.arm)
                if known is None or not leading or not known.by.issuperset(leading):  # jogged anew
                    known = Jogged(leading, frozenset())
                own = JOG_CONTROLLER if isinstance(jog, JointsJog) else CARTESIAN_CONTROLLER
                self._live.jogged[jog.arm] = known._replace(by=known.by | {own})
                if isinstance(jog, ToolJog) and (position := state.arms[jog.arm].position) is not None:
                    jog = within_joint_speed(jog, position)
                await self._link.ask(jog.request)
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
    after = Pose((x, y, z), multiply(quaternion_of(angular, step), tip.orientation))
    target = wrist_target(side, compose(after, inverse(FINGERTIPS)), now.angle + step * jog.elbow)
    fastest = max(map(abs, DifferentialSolver(now).change(target_error(now, target)))) / step
    share = min(1.0, MAX_JOINT_SPEED / max(fastest, 1e-9))
    (a, b, c), (d, e, f) = jog.linear, jog.angular
    return msgspec.structs.replace(
        jog,
        linear=(share * a, share * b, share * c),
        angular=(share * d, share * e, share * f),
        elbow=share * jog.elbow,
    )


def said_of(error: Exception) -> Message:
    """What an exception says; what is no refusal is a fault of ours, which the log shows whole."""
    if isinstance(error, YumiError):
        return error.said
    log.error("What a page has asked for failed with %s: %s", type(error).__name__, error, exc_info=error)
    return message("view_failed", kind=type(error).__name__, why=said_by(error))


def words_for_page(said: Message, *, is_virtual: bool) -> Mapping[str, object]:
    """A message in the page's words, with the first thing that a person can do about it."""
    if is_virtual and said.code == "feedback_lost":  # a virtual robot falls silent where its machine has no time for it
        said = Message("virtual_robot_was_late", said.values)
    front_end = FrontEnd.VIRTUAL_PAGE if is_virtual else FrontEnd.PAGE
    action = said.actions[0].value if said.actions else None
    return {"code": said.code, "sentence": sentence(said, front_end), "action": action}


def failure_for_page(error: Exception, *, is_virtual: bool) -> Mapping[str, object]:
    """What a page gets of an exception."""
    stop = getattr(error, "stop", "")
    return {"kind": type(error).__name__, "stop": stop, **words_for_page(said_of(error), is_virtual=is_virtual)}


# ---- what a page sends

MAX_JOINT_SPEED = 0.5
"""No joint or elbow is jogged faster than this [rad/s], before speed_scale: it stops within 0.2 s of a lost link."""

MAX_LINEAR, MAX_ANGULAR = 0.15, 0.5
"""The tool is not jogged faster than this [m/s], [rad/s], before speed_scale; for the same reason."""

_Speed = Annotated[float, msgspec.Meta(ge=-MAX_JOINT_SPEED, le=MAX_JOINT_SPEED)]
_Linear = Annotated[float, msgspec.Meta(ge=-MAX_LINEAR, le=MAX_LINEAR)]
_Angular = Annotated[float, msgspec.Meta(ge=-MAX_ANGULAR, le=MAX_ANGULAR)]


class PageMessage(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="type"):
    """What a page sends."""


class TakeControl(PageMessage, frozen=True, tag="take_control"):
    """A person has clicked on it; a page that has control loses it."""


class GiveBack(PageMessage, frozen=True, tag="give_back"):
    """Control is given back."""


class Ask(PageMessage, frozen=True, tag="ask"):
    """What the driver is asked for; answers have this ``id``. Jogs have messages of their own, with limits."""

    id: int
    request: StartEgm | StopEgm | Recover | Calibrate | Grip | Move | SwitchControllers | SetSpeedScale


class Inject(PageMessage, frozen=True, tag="inject"):
    """A fault for a virtual robot, with the options of ``yumi fault``."""

    id: int
    name: str
    form: dict[str, str] = {}


class Seen(PageMessage, frozen=True, tag="seen"):
    """The state that was sent is shown; the next one may come."""


class PlanMotion(PageMessage, frozen=True, tag="plan"):
    """Plan a motion around everything, and show it: to positions as :class:`yumi.driver.endpoint.Move` has them.

    With ``is_pose`` they are poses of the fingertips in the body's frame: x, y, z [m], quaternion w, x, y, z.
    """

    id: int
    right: Position | None = None
    left: Position | None = None
    is_pose: bool = False


class ExecutePlan(PageMessage, frozen=True, tag="execute"):
    """Follow the plan that was shown under this number."""

    id: int
    plan: int


class JointsJog(PageMessage, frozen=True, tag="jog_joints"):
    """A key is held: joint speeds of an arm [rad/s]; zeros when it is released.

    ``hold`` counts the holds, and ``seen`` is the time of the state that the page has got last.
    """

    arm: Arm
    hold: int
    seen: float
    speeds: tuple[_Speed, _Speed, _Speed, _Speed, _Speed, _Speed, _Speed]

    @property
    def request(self) -> Request:
        """What the driver is asked for."""
        return Jog(arm=self.arm, speeds=self.speeds)

    @property
    def at_rest(self) -> Request:
        """The same without motion."""
        return Jog(arm=self.arm, speeds=ZERO)


class ToolJog(PageMessage, frozen=True, tag="jog_tool"):
    """A key is held: speeds of the tool [m/s], [rad/s] in a frame, or of the elbow [rad/s]."""

    arm: Arm
    hold: int
    seen: float
    frame: Literal["base", "tool"] = "base"
    linear: tuple[_Linear, _Linear, _Linear] = (0.0, 0.0, 0.0)
    angular: tuple[_Angular, _Angular, _Angular] = (0.0, 0.0, 0.0)
    elbow: _Speed = 0.0

    @property
    def request(self) -> Request:
        """What the driver is asked for."""
        return JogTool(arm=self.arm, linear=self.linear, angular=self.angular, elbow=self.elbow, frame=self.frame)

    @property
    def at_rest(self) -> Request:
        """The same without motion."""
        return JogTool(arm=self.arm, frame=self.frame)


AnyJog = JointsJog | ToolJog
AnyMessage = TakeControl | GiveBack | Seen | Ask | Inject | PlanMotion | ExecutePlan | AnyJog

# ---- what is nearest

NEAR = 0.05
"""Parts further from each other than this are not shown [m]."""


class Distances:
    """Finds the two parts that are nearest to each other: each two parts of different arms, and each part and box.

    The body is left out: at home the arms are within a few millimetres of it.

    Args:
        surroundings: grippers, tools and boxes.
    """

    def __init__(self, surroundings: Surroundings) -> None:
        grippers, tools, obstacles = shapes_of(surroundings)
        self._model = CollisionModel(grippers, tools=tools, obstacles=obstacles)

    def nearest(self, positions: Mapping[Side, Joints], only: Collection[tuple[str, str]] = ()) -> Distance | None:
        """Of arms at joint positions [rad], both (7,); None where nothing is within :data:`NEAR`.

        ``only``: look among these pairs of parts alone, also with the body; by names, such as what limits the arms.
        """
        if not only:
            return next(iter(self._model.nearest(positions, within=NEAR, ignore=BODY)), None)
        wanted = {frozenset(pair) for pair in only}
        near = self._model.nearest(positions, len(self._model.names) ** 2, within=NEAR)
        return next((each for each in near if frozenset((each.part, each.other)) in wanted), None)


# ---- plans

PLANNED_SPEED_SCALE = 0.5
"""Share of the joints' speeds that a page plans for, before speed_scale."""

_PLANNING_TIMEOUT = 20.0  # [s] for one plan


# ---- the connection to the driver

_LONGEST_LINE = 1 << 22  # of a driver [bytes]; a state has some kilobytes
_answer_decoder = msgspec.json.Decoder(Answer)


class DriverLink:
    """A connection to a running driver, on one event loop. What is closed stops the motions it has asked for."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self._writer = reader, writer
        self._number = 0
        self._waiting: dict[int, asyncio.Queue[Answer | RobotNotReady]] = {}
        self._reading = asyncio.create_task(self._read())

    @classmethod
    async def open(cls, robot: str = "") -> DriverLink:
        """Connect to the one driver that runs, or to that of ``robot``.

        Raises:
            RobotNotReady: none runs, or several do; the message says what to do.
        """
        path: Path = await asyncio.to_thread(find_driver, robot)  # it may try sockets
        try:
            reader, writer = await asyncio.open_unix_connection(path, limit=_LONGEST_LINE)
        except (ConnectionRefusedError, FileNotFoundError) as error:
            if isinstance(error, ConnectionRefusedError):
                path.unlink(missing_ok=True)  # of a driver that was killed
            raise RobotNotReady(message("no_driver_runs")) from error
        except OSError as error:
            raise RobotNotReady(message("driver_does_not_answer", path=path.name, why=said_by(error))) from error
        link = cls(reader, writer)
        link._write(Attach())  # a page that has taken control may ask for nothing for long
        return link

    async def close(self) -> None:
        """Disconnect; a motion that was asked for over it is stopped."""
        self._reading.cancel()
        self._writer.close()
        with suppress(OSError):
            await self._writer.wait_closed()

    async def ask(
        self,
        request: Request,
        on_step: Callable[[str], None] = lambda step: None,
        on_motion: Callable[[dict[str, MotionReport]], None] = lambda motions: None,
    ) -> msgspec.Raw:
        """Send a request and wait for its result, as JSON.

        Raises:
            YumiError: the driver refuses or has failed, with its sentence; or the connection is lost.
        """
        number, answers = await self._send(request)
        try:
            while True:
                answer = await self._next(answers)
                if answer.step:
                    on_step(answer.step)
                if answer.motions:
                    on_motion(answer.motions)
                if answer.result:
                    return answer.result
        finally:
            del self._waiting[number]

    async def states(self, rate: float) -> AsyncIterator[tuple[msgspec.Raw, tuple[EventReport, ...]]]:
        """The state ``rate`` times a second, as JSON, with the events since the one before; raises as :meth:`ask`."""
        number, answers = await self._send(Subscribe(rate=rate))
        try:
            while True:
                try:
                    answer = await asyncio.wait_for(self._next(answers), ANSWER)
                except asyncio.TimeoutError as error:
                    raise RobotNotReady(message("driver_sent_no_state", duration=ANSWER)) from error
                if answer.state:
                    yield answer.state, answer.events
        finally:
            del self._waiting[number]

    async def _send(self, request: Request) -> tuple[int, asyncio.Queue[Answer | RobotNotReady]]:
        if self._reading.done():
            raise self._lost(message("driver_closed_connection"))
        self._number += 1
        number, answers = self._number, asyncio.Queue[Answer | RobotNotReady]()
        self._waiting[number] = answers
        self._write(msgspec.structs.replace(request, id=number))
        try:
            await self._writer.drain()
        except OSError as error:
            del self._waiting[number]
            raise self._lost(said_by(error)) from error
        return number, answers

    def _write(self, request: Request) -> None:
        self._writer.write(msgspec.json.encode(request) + b"\n")

    async def _next(self, answers: asyncio.Queue[Answer | RobotNotReady]) -> Answer:
        answer = await answers.get()
        if isinstance(answer, RobotNotReady):
            raise answer
        if answer.error is not None:
            raise error_of(answer.error)
        return answer

    async def _read(self) -> None:
        why = message("driver_closed_connection")
        try:
            while line := await self._reader.readline():
                answer = _answer_decoder.decode(line)
                # What has no number is about the whole connection, such as one client too many.
                for number in (answer.id,) if answer.id else tuple(self._waiting):
                    if number in self._waiting:
                        self._waiting[number].put_nowait(answer)
        except (OSError, ValueError, msgspec.DecodeError) as error:
            why = said_by(error)
        finally:
            for each in self._waiting.values():
                each.put_nowait(self._lost(why))

    @staticmethod
    def _lost(why: Message) -> RobotNotReady:
        return RobotNotReady(message("connection_to_driver_lost", why=why))
