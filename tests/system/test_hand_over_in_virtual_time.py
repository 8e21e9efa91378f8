"""A person at the page and a script want the same arm: who commands it, and what each of them hears."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from math import cos
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import pytest

from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import CommandRefused, GoalNotReached
from abb_protocols.robot.description import FINGERTIPS
from abb_protocols.robot.joints import CYCLE, ZERO_JOINTS, Joints, Side, joints
from abb_protocols.robot.kinematics import tool0_to_body
from cartesian_bench import shares
from refusals import refused
from system.teleoperation_bench import LEFT_START, RATE, RELEASED, RIGHT, START, WITHIN, at, driver_in_egm, operator_of
from system.test_endpoint_in_virtual_time import Driver
from yumi.api.motion_registry import Motion
from yumi.control.controller import CONTROLLER_IDLE_TIME
from yumi.control.hand_over import Commander, is_person_requesting, requested_by
from yumi.control.loop_commands import ControllerCommand
from yumi.control.motion.robot_response import STANDING
from yumi.control.motion.setpoint import largest_difference
from yumi.control.motion.standstill import STANDSTILL_TOLERANCE
from yumi.control.trajectory_commands import CancelTrajectory
from yumi.driver import motion_commands
from yumi.driver.command import Caller, Command
from yumi.driver.commands import Calibrate, GiveBack, Grip, carry_out
from yumi.driver.controller_names import GOAL_CONTROLLER, JOG_CONTROLLER, STREAM_CONTROLLER
from yumi.driver.device_frame import DeviceFrame, DeviceHand
from yumi.driver.motion_commands import Jog, Move, Stream, Teleoperate

PAGE = Caller(client="page", front_end=FrontEnd.PAGE)
SCRIPT = Caller(client="script")
SPEEDS = joints([0.2] * 7)
FAR: Joints = joints([value + 0.5 for value in START])


class Clients:
    """Clients of a driver, whose commands wait on threads of their own while time goes by."""

    def __init__(self, driver: Driver, pool: ThreadPoolExecutor) -> None:
        self.driver = driver
        self.pool = pool

    def begin(self, command: Command[Any], caller: Caller) -> Future[Any]:
        return self.pool.submit(carry_out, command, self.driver.server._robot, caller)

    def done(self, command: Command[Any], caller: Caller) -> Any:
        """The result of a command; time goes by meanwhile."""
        return self.ended(self.begin(command, caller))

    def ended(self, future: Future[Any]) -> Any:
        while not future.done():
            self.driver.wait(0.02)
            wait([future], 0.002)
        return future.result()

    def jog(self, seconds: float) -> None:
        """A key is held at the page, which says when it was; only to take the arm over takes time."""
        begin = self.driver.now()
        self.done(Jog(arm="right", speeds=SPEEDS), PAGE)
        while self.driver.now() - begin < seconds:
            self.begin(Jog(arm="right", speeds=SPEEDS, time=self.driver.now()), PAGE).result(10.0)
            self.driver.wait(0.02)


@pytest.fixture
def clients(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Clients]:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with driver_in_egm() as driver, ThreadPoolExecutor(4) as pool:
        yield Clients(driver, pool)


def command(clients: Clients) -> tuple[Commander, bool]:
    now = clients.driver.hand_over.of(RIGHT)
    return now.who, now.is_reserved


def test_person_takes_an_arm_from_a_scripts_move_and_gives_it_back(clients: Clients) -> None:
    driver = clients.driver
    moving = clients.begin(Move(right=FAR, left=LEFT_START, speed_scale=0.2), SCRIPT)
    driver.until(lambda: driver.mover.is_moving(RIGHT), 5.0)
    driver.wait(0.3)
    assert command(clients) == (Commander.TRAJECTORY, False)
    clients.jog(0.5)
    with pytest.raises(GoalNotReached):
        clients.ended(moving)
    assert command(clients) == (Commander.PAGE, False)
    with refused(CommandRefused, "arm_commanded_by_another", who="page", client="page"):
        clients.done(Move(right=START), SCRIPT)
    driver.wait(1.0)
    assert command(clients) == (Commander.NONE, True)
    still = driver.snapshot(RIGHT).sent
    for attempt in (Move(right=START), Jog(arm="right", speeds=SPEEDS)):
        with refused(CommandRefused, "arm_reserved_for_person", arm="right"):
            clients.done(attempt, SCRIPT)
    driver.wait(0.5)
    assert driver.snapshot(RIGHT).sent == pytest.approx(still, abs=1e-9)
    report = driver.server._robot.state().arms["right"].command
    assert [said.code for said in report.said] == ["reserved_for_person", "last_take_over_refused"]
    clients.done(Move(left=LEFT_START), SCRIPT)  # the other arm is nobody's
    clients.done(GiveBack(arms=("right",)), PAGE)
    begin = len(driver.arms[RIGHT].admitted)
    clients.done(Move(right=START), SCRIPT)
    driver.wait(0.1)  # what is sent comes after what is commanded
    # The jog's controller begins where the arm is measured, as soon as the thread of the move gives it the arm back.
    moved = driver.arms[RIGHT].admitted[begin:]
    assert min(largest_difference(sent, START) for sent in moved) <= 1e-5
    assert driver.snapshot(RIGHT).sent == pytest.approx(START, abs=STANDSTILL_TOLERANCE)
    for side in Side:
        assert max(shares(np.array(driver.arms[side].admitted))) <= max(WITHIN)


@pytest.mark.parametrize("is_let_go", [False, True])
def test_program_that_was_granted_an_arm_before_a_person_took_it_does_not_stop_it_afterwards(
    clients: Clients, monkeypatch: pytest.MonkeyPatch, is_let_go: bool
) -> None:
    driver = clients.driver
    take_all = driver.hand_over.take_all

    def grant_and_be_late(
        sides: Collection[Side], kind: Commander, lasts: float | None = CONTROLLER_IDLE_TIME
    ) -> frozenset[Side]:
        handed_over = take_all(sides, kind, lasts)
        monkeypatch.undo()
        clients.jog(0.5)
        driver.wait(1.0 if is_let_go else CYCLE)
        return handed_over

    monkeypatch.setattr(driver.hand_over, "take_all", grant_and_be_late)
    code = "arm_reserved_for_person" if is_let_go else "arm_commanded_by_another"
    with requested_by(Commander.POLICY, "policy", "policy"), refused(CommandRefused, code):
        driver.mover.stream({RIGHT: START}, blend=0.5)
    assert driver.mover.commanding(RIGHT) == (JOG_CONTROLLER,)
    sent = driver.snapshot(RIGHT).sent
    if is_let_go:
        driver.wait(0.5)
        assert driver.snapshot(RIGHT).sent == sent
    else:
        clients.jog(0.2)
        assert driver.snapshot(RIGHT).sent[6] > sent[6] + 0.02  # it goes on as it was


def stream(driver: Driver) -> None:
    driver.mover.stream({RIGHT: START}, blend=0.5)


def follow_line(driver: Driver) -> None:
    place = tool0_to_body(RIGHT, driver.snapshot(RIGHT).sent, FINGERTIPS).position
    driver.mover.move_tools({RIGHT: place}, {RIGHT: FINGERTIPS}, None, None, None, is_linear=True)


def jog_tool(driver: Driver) -> None:
    driver.mover.jog_tool(RIGHT, ZERO_JOINTS, FINGERTIPS, "policy", is_in_tool=False)


@pytest.mark.parametrize(
    ("program", "passed", "code"),
    [
        (stream, "activate", "arm_commanded_by_another"),  # it has switched the controllers to stop the arm
        (follow_line, "activate", "arm_commanded_by_another"),
        (stream, "take_over", "arm_commanded_by_another"),  # and to move it
        (follow_line, "take_over", "arm_commanded_by_another"),
        (jog_tool, "_begin_stream", "jog_streamed_by_another"),
    ],
)
def test_program_that_is_late_while_it_takes_an_arm_over_does_not_end_what_a_person_has_begun(
    clients: Clients, monkeypatch: pytest.MonkeyPatch, program: Callable[[Driver], None], passed: str, code: str
) -> None:
    driver, mover, send = clients.driver, clients.driver.mover, clients.driver.mover.send
    pass_step, is_late, goes_on, is_stopping = getattr(mover, passed), Event(), Event(), Event()

    def be_late(*args: Any, **options: Any) -> Any:
        result = pass_step(*args, **options)
        if not is_late.is_set():
            is_late.set()
            assert goes_on.wait(20.0)
        return result

    def send_and_report(commands: Sequence[ControllerCommand], motions: tuple[Motion, ...]) -> tuple[Motion, ...]:
        sent = send(commands, motions)
        if is_person_requesting():
            is_stopping.set()
        return sent

    def run() -> None:
        with requested_by(Commander.POLICY, "policy", "policy"):
            program(driver)

    if program is jog_tool:
        clients.ended(clients.pool.submit(run))
    monkeypatch.setattr(mover, passed, be_late)
    monkeypatch.setattr(mover, "send", send_and_report)
    running = clients.pool.submit(run)
    while not is_late.wait(0.002):
        driver.wait(CYCLE)
    with operator_of(driver) as operator:
        if passed == "activate":
            operator.send(RELEASED)
            operator.send(at(), driver.now() + CYCLE)
            assert is_stopping.wait(10.0)  # the stop of the person is not over: no time goes by
        else:
            operator.engage(at())
        goes_on.set()
        wait([running], 1.0)
        operator.hold(0.2, lambda time: at())
        while operator.clutch == "engaging":
            operator.hold(1.0 / RATE, lambda time: at())
        assert operator.clutch == "engaged", operator.why
    with refused(CommandRefused, code):
        clients.ended(running)


def test_end_of_a_programs_jog_that_comes_late_does_not_brake_the_arm_of_a_person(
    clients: Clients, monkeypatch: pytest.MonkeyPatch
) -> None:
    driver, mover, call = clients.driver, clients.driver.mover, clients.driver.call
    is_late, goes_on = Event(), Event()

    def jog() -> None:
        with requested_by(Commander.POLICY, "policy", "policy"):
            mover.jog_tool(RIGHT, (0.0, 0.0, 0.02, 0.0, 0.0, 0.0, 0.0), FINGERTIPS, "policy", is_in_tool=False)

    def be_late(command: Callable[..., Any], *args: Any) -> Any:
        if any(isinstance(each, ControllerCommand) and isinstance(each.message, CancelTrajectory) for each in args):
            monkeypatch.undo()
            is_late.set()
            assert goes_on.wait(60.0)
        return call(command, *args)

    for _ in range(5):
        clients.ended(clients.pool.submit(jog))
    monkeypatch.setattr(driver, "call", be_late)
    ending = clients.pool.submit(mover.end_jog, RIGHT, "policy")
    assert is_late.wait(10.0)
    with operator_of(driver) as operator:
        operator.engage(at())
        speeds = []

        def hand(time: float) -> DeviceHand:
            if time > 0.7 and not goes_on.is_set():
                goes_on.set()
                ending.result(10.0)
            if time > 0.6:
                speeds.append(max(map(abs, driver.snapshot(RIGHT).velocity)))
            return at(x=0.1 * time)

        operator.hold(1.0, hand)
    assert operator.clutch == "engaged"
    assert max(speeds) < 1.5 * min(speeds)


@pytest.mark.parametrize("way", ["jogged by a person", "moved by a person", "stopped", "client gone"])
def test_move_of_both_arms_that_ends_on_one_ends_on_the_other_and_does_not_go_on(clients: Clients, way: str) -> None:
    driver, gone = clients.driver, Event()
    goals = {RIGHT: joints([*START[:6], START[6] + 1.0]), Side.LEFT: joints([*LEFT_START[:6], LEFT_START[6] - 1.0])}
    script = Caller(client="script", is_gone=gone.is_set)
    moving = clients.begin(Move(right=goals[RIGHT], left=goals[Side.LEFT], speed_scale=0.05), script)
    driver.until(lambda: min(max(map(abs, driver.snapshot(side).velocity)) for side in Side) > 0.1, 5.0)
    if way == "jogged by a person":
        clients.jog(0.3)
    elif way == "moved by a person":
        clients.done(Move(right=START), PAGE)
    elif way == "stopped":
        driver.mover.stop((RIGHT,))
    else:
        gone.set()
    with pytest.raises(GoalNotReached):
        clients.ended(moving)
    driver.wait(0.5)
    still = {side: driver.snapshot(side).sent for side in Side}
    driver.wait(1.0)
    for side, goal in goals.items():
        assert driver.snapshot(side).sent == pytest.approx(still[side], abs=1e-9)
        assert abs(still[side][6] - goal[6]) > 0.2
        assert max(shares(np.array(driver.arms[side].admitted))) <= max(WITHIN)


def test_move_of_both_arms_gives_one_back_also_where_a_person_takes_the_other_one_at_its_end(
    clients: Clients, monkeypatch: pytest.MonkeyPatch
) -> None:
    driver, wait_for_motions = clients.driver, motion_commands._wait

    def wait_and_be_late(*args: Any) -> None:
        wait_for_motions(*args)
        with requested_by(Commander.HEADSET, "person"):
            driver.hand_over.take(RIGHT, Commander.HEADSET)

    clients.done(Stream(right=START, left=LEFT_START), SCRIPT)
    monkeypatch.setattr(motion_commands, "_wait", wait_and_be_late)
    clients.done(Move(right=START, left=LEFT_START), SCRIPT)
    assert [driver.mover.commanding(side) for side in (RIGHT, Side.LEFT)] == [(GOAL_CONTROLLER,), (STREAM_CONTROLLER,)]


def slow_move(clients: Clients, front_end: FrontEnd, gone: Event) -> Future[Any]:
    """A move below the speed at which an arm counts as standing, which is under way."""
    driver, caller = clients.driver, Caller(client="slow", front_end=front_end, is_gone=gone.is_set)
    moving = clients.begin(Move(right=FAR, speed_scale=0.01), caller)
    driver.until(lambda: driver.snapshot(RIGHT).sent[6] > START[6] + 0.01, 5.0)
    assert max(map(abs, driver.snapshot(RIGHT).velocity)) < STANDING
    return moving


@pytest.mark.parametrize("front_end", [FrontEnd.PAGE, FrontEnd.SCRIPT])
def test_slow_move_keeps_its_arm_and_ends_where_its_client_is_gone(clients: Clients, front_end: FrontEnd) -> None:
    driver, gone = clients.driver, Event()
    moving = slow_move(clients, front_end, gone)
    commander = Commander.PAGE if front_end is FrontEnd.PAGE else Commander.TRAJECTORY
    assert command(clients) == (commander, False)
    gone.set()
    with refused(GoalNotReached, "motion_stopped_asker_gone"):
        clients.ended(moving)
    driver.wait(0.5)
    still = driver.snapshot(RIGHT).sent
    driver.wait(1.0)
    assert driver.snapshot(RIGHT).sent == pytest.approx(still, abs=1e-9)


def test_person_takes_an_arm_from_a_slow_move_of_a_script(clients: Clients) -> None:
    gone = Event()
    moving = slow_move(clients, FrontEnd.SCRIPT, gone)
    try:
        clients.jog(0.3)
        assert command(clients) == (Commander.PAGE, False)
    finally:
        gone.set()
        with pytest.raises(GoalNotReached):
            clients.ended(moving)


def test_move_of_the_page_is_a_persons_and_no_scripts_move_follows_it_by_itself(clients: Clients) -> None:
    moving = clients.begin(Move(right=FAR, speed_scale=0.2), SCRIPT)
    clients.driver.until(lambda: clients.driver.mover.is_moving(RIGHT), 5.0)
    clients.driver.wait(0.3)
    clients.done(Move(right=START), PAGE)
    with pytest.raises(GoalNotReached):
        clients.ended(moving)
    clients.driver.wait(0.5)
    assert command(clients) == (Commander.NONE, True)
    with refused(CommandRefused, "arm_reserved_for_person"):
        clients.done(Move(right=FAR), SCRIPT)
    clients.done(Move(right=FAR, speed_scale=0.5), PAGE)


def test_move_of_the_page_stays_a_persons_while_the_page_sends_frames_of_an_idle_device(clients: Clients) -> None:
    driver = clients.driver
    moving = clients.begin(Move(right=FAR, speed_scale=0.2), PAGE)
    driver.until(lambda: driver.mover.is_moving(RIGHT), 5.0)
    commanded = []
    for _ in range(3):
        clients.done(Teleoperate(frame=DeviceFrame(time=driver.now())), PAGE)
        commanded.append(command(clients))
        driver.wait(0.05)
    clients.ended(moving)
    assert commanded == [(Commander.PAGE, False)] * 3
    assert driver.snapshot(RIGHT).sent == pytest.approx(FAR, abs=1e-3)


def test_person_takes_one_arm_of_a_stream_and_the_other_one_brakes_and_holds(clients: Clients) -> None:
    driver = clients.driver
    begin = driver.now()

    def point(blend: float | None = None) -> Stream:
        time = driver.now()
        turn = 0.2 * (1.0 - cos(1.5 * (time - begin)))
        return Stream(
            right=(*START[:6], START[6] + turn), left=(*LEFT_START[:6], LEFT_START[6] - turn), time=time, blend=blend
        )

    def stream(seconds: float, blend: float | None = None) -> None:
        end = driver.now() + seconds
        while driver.now() < end:
            clients.done(point(blend), SCRIPT)
            driver.wait(1.0 / 30.0)

    stream(1.0)
    assert {driver.hand_over.of(side).who for side in Side} == {Commander.STREAM}
    assert max(map(abs, driver.snapshot(Side.LEFT).velocity)) > 0.05
    clients.jog(0.3)
    with refused(CommandRefused, "arm_commanded_by_another", arm="right", who="page"):
        clients.done(point(), SCRIPT)
    driver.wait(0.5)
    still = driver.snapshot(Side.LEFT).sent
    driver.wait(1.0)
    assert driver.snapshot(Side.LEFT).sent == pytest.approx(still, abs=1e-9)
    with refused(CommandRefused, "arm_reserved_for_person", arm="right"):
        clients.done(point(), SCRIPT)
    clients.done(GiveBack(arms=("right",)), PAGE)
    stream(2.0, blend=1.0)
    for side, start, sign in ((RIGHT, START, 1.0), (Side.LEFT, LEFT_START, -1.0)):
        turn = 0.2 * (1.0 - cos(1.5 * (driver.now() - begin)))
        assert driver.snapshot(side).sent == pytest.approx((*start[:6], start[6] + sign * turn), abs=0.05)
        assert max(shares(np.array(driver.arms[side].admitted))) <= max(WITHIN)


def test_stream_of_one_arm_goes_on_while_a_jog_of_the_other_one_is_carried_out(
    clients: Clients, monkeypatch: pytest.MonkeyPatch
) -> None:
    driver, jog, has_begun, goes_on = clients.driver, clients.driver.mover.jog, Event(), Event()

    def jog_later(*args: Any) -> bool:
        has_begun.set()
        assert goes_on.wait(10.0)
        return jog(*args)

    clients.done(Stream(right=START), SCRIPT)
    monkeypatch.setattr(driver.mover, "jog", jog_later)
    monkeypatch.setattr(motion_commands, "MOTION_BEGINS", 10.0)  # of this machine's clock
    jogging = clients.begin(Jog(arm="left", speeds=SPEEDS, time=driver.now()), PAGE)
    assert has_begun.wait(10.0)
    streaming = clients.begin(Stream(right=START), SCRIPT)
    wait([streaming], 0.3)
    goes_on.set()
    clients.ended(streaming)
    clients.ended(jogging)
    assert {side: driver.hand_over.of(side).who for side in Side} == {
        RIGHT: Commander.STREAM,
        Side.LEFT: Commander.PAGE,
    }


def test_stop_of_a_script_is_open_to_it_while_a_person_commands(clients: Clients) -> None:
    clients.jog(0.3)

    clients.driver.mover.stop((RIGHT,))
    clients.driver.wait(0.3)
    before = clients.driver.snapshot(RIGHT).sent
    clients.driver.wait(0.3)
    assert clients.driver.snapshot(RIGHT).sent == pytest.approx(before, abs=1e-9)


def test_grippers_of_a_stream_are_refused_as_the_arm_itself_is(clients: Clients) -> None:
    driver = clients.driver
    clients.jog(0.3)
    fingers = {side: driver.world.grippers[side].position for side in Side}
    grips = Stream(grippers={"right": 0.02, "left": 0.02})
    with refused(CommandRefused, "arm_commanded_by_another", arm="right", who="page"):
        clients.done(grips, SCRIPT)
    driver.wait(1.0)
    turned = Stream(left=(*LEFT_START[:6], LEFT_START[6] + 0.01), grippers={"right": 0.02})
    for stream in (grips, turned):  # all of it is refused, also for the other arm
        with refused(CommandRefused, "arm_reserved_for_person", arm="right"):
            clients.done(stream, SCRIPT)
    driver.wait(1.0)
    assert {side: driver.world.grippers[side].position for side in Side} == fingers
    assert driver.snapshot(Side.LEFT).sent == pytest.approx(LEFT_START, abs=1e-9)
    clients.done(GiveBack(arms=("right",)), PAGE)
    clients.done(grips, SCRIPT)
    driver.wait(1.0)
    assert all(driver.world.grippers[side].position != fingers[side] for side in Side)


def test_grippers_of_programs_are_refused_as_the_arm_itself_is_and_a_person_may_grip(clients: Clients) -> None:
    driver = clients.driver
    fingers = driver.world.grippers[RIGHT].position
    close, calibrate = Grip(arm="right", action="close"), Calibrate(arms=("right",))
    clients.jog(0.3)
    for _ in ("the person commands", "the arm is reserved"):
        for command in (close, calibrate):
            with refused(CommandRefused, "gripper_reserved_for_person", gripper="right"):
                clients.done(command, SCRIPT)
        driver.wait(1.0)
    assert driver.grippers[RIGHT].goal is None
    assert driver.hand_over.of(RIGHT).refused is None
    assert driver.world.grippers[RIGHT].position == fingers
    clients.done(Grip(arm="left", action="close"), SCRIPT)
    clients.done(Grip(arm="right", action="open", width=0.02), PAGE)
    assert driver.world.grippers[RIGHT].position == pytest.approx(0.01, abs=1e-3)
    clients.done(GiveBack(arms=("right",)), PAGE)
    clients.done(close, SCRIPT)
    assert driver.world.grippers[RIGHT].position == pytest.approx(0.0, abs=1e-3)


def test_gripper_of_an_arm_that_a_person_takes_while_a_stream_begins_stays_and_the_other_one_follows(
    clients: Clients, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    driver, stream = clients.driver, clients.driver.mover.stream
    fingers = {side: driver.world.grippers[side].position for side in Side}

    def be_late(*args: Any) -> bool:
        has_switched = stream(*args)
        with requested_by(Commander.HEADSET, "person"):
            driver.hand_over.take(RIGHT, Commander.HEADSET)
        return has_switched

    monkeypatch.setattr(driver.mover, "stream", be_late)
    clients.done(Stream(left=LEFT_START, grippers={"right": 0.02, "left": 0.02}), SCRIPT)
    driver.wait(1.0)
    assert [side for side in Side if driver.world.grippers[side].position != fingers[side]] == [Side.LEFT]
    assert "commanded by headset" in caplog.text


def test_line_to_a_pose_that_no_arm_reaches_leaves_the_arm_to_other_clients(clients: Clients) -> None:
    with pytest.raises(CommandRefused):
        clients.done(Move(right=(3.0, 0.0, 0.3), is_pose=True, is_linear=True), SCRIPT)
    assert command(clients) == (Commander.NONE, False)
