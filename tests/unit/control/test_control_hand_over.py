"""Who may take an arm over from whom, and what is left when somebody lets it go."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from math import inf, isnan
from threading import Event as Flag
from threading import Thread

import numpy as np
import pytest

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, RobotNotReady
from abb_protocols.robot.joints import YUMI_LIMITS, ZERO_JOINTS, Joints, Side, home, joints
from abb_runtime.clock import ManualClock
from refusals import refused
from unit.robot.test_robot_kinematics import rad
from yumi.control.chunk_commands import FollowChunk
from yumi.control.controller import CONTROLLER_IDLE_TIME
from yumi.control.controllers.joint_goal import JointGoal, StopMotion
from yumi.control.goals import UNKNOWN_JOINTS
from yumi.control.hand_over import Commander, HandOver, requested_by
from yumi.control.loop_commands import Commands, ControllerCommand
from yumi.control.loop_events import ArmGivenBack, CommanderChanged, CommanderSilent, Event
from yumi.control.motion.stream_begin import StreamBegin
from yumi.control.trajectory_commands import CancelTrajectory
from yumi.planning.chunk_plan import plan_chunk

RIGHT, LEFT = Side.RIGHT, Side.LEFT
SOON = 0.1  # [s]
PERSONS = [Commander.PAGE, Commander.HEADSET, Commander.DEVICE, Commander.LEAD_THROUGH]
PROGRAMS = [Commander.TRAJECTORY, Commander.PLANNER, Commander.STREAM, Commander.POLICY, Commander.RAPID]


class Arms(HandOver):
    """The hand-over of arms that the test has move.

    Attributes:
        clock: of it.
        moving: those that move.
        events: what happened.
    """

    def __init__(self) -> None:
        self.clock = ManualClock(100.0)
        self.moving: set[Side] = set()
        self.events: list[Event] = []
        super().__init__(self.clock.now, lambda side: side in self.moving, self.events.append)

    def taken(
        self, who: Commander, client: object = None, lasts: float | None = CONTROLLER_IDLE_TIME, side: Side = RIGHT
    ) -> bool:
        with requested_by(who, client, str(client)):  # type: ignore[arg-type]
            return self.take(side, who, lasts)


@pytest.fixture
def arms() -> Arms:
    return Arms()


def test_every_commander_is_a_person_or_a_program_or_none() -> None:
    assert {who for who in Commander if who.is_person} == set(PERSONS)
    assert {*PERSONS, *PROGRAMS, Commander.NONE} == set(Commander)


@pytest.mark.parametrize("person", PERSONS)
@pytest.mark.parametrize("program", PROGRAMS)
def test_person_takes_an_arm_from_a_program_and_no_program_takes_one_back(
    arms: Arms, person: Commander, program: Commander
) -> None:
    arms.taken(program, "program")
    assert arms.taken(person, "person")
    with refused(CommandRefused, "arm_commanded_by_another", arm="right", who=person.value, client="person"):
        arms.taken(program, "program")
    assert arms.of(RIGHT).who is person
    assert arms.of(LEFT).who is Commander.NONE


@pytest.mark.parametrize(("first", "second"), [("STREAM", "POLICY"), ("TRAJECTORY", "PLANNER"), ("PAGE", "HEADSET")])
def test_one_who_commands_keeps_the_arm_from_those_of_the_same_rank(arms: Arms, first: str, second: str) -> None:
    arms.taken(Commander[first], "first")
    with refused(CommandRefused, "arm_commanded_by_another", who=Commander[first].value):
        arms.taken(Commander[second], "second")
    assert not arms.taken(Commander[second], "first")  # the same client goes on in another way
    assert arms.of(RIGHT).who is Commander[second]


def test_stream_is_over_a_second_after_its_last_goal_and_a_motion_when_the_arm_stands(arms: Arms) -> None:
    arms.taken(Commander.STREAM, "stream")
    arms.clock.advance(CONTROLLER_IDLE_TIME)
    assert arms.of(RIGHT).who is Commander.STREAM
    arms.clock.advance(0.01)
    assert arms.of(RIGHT).who is Commander.NONE
    arms.moving.add(RIGHT)
    arms.taken(Commander.STREAM, "stream")
    arms.clock.advance(2.0 * CONTROLLER_IDLE_TIME)  # its last points are for later, and the arm is not there yet
    assert arms.of(RIGHT).who is Commander.STREAM
    arms.moving.clear()
    assert arms.of(RIGHT).who is Commander.NONE
    arms.moving.add(RIGHT)
    arms.taken(Commander.TRAJECTORY, "script", None)
    arms.clock.advance(60.0)
    assert arms.of(RIGHT).who is Commander.TRAJECTORY
    arms.moving.clear()
    assert arms.of(RIGHT).who is Commander.NONE
    assert not arms.of(RIGHT).is_reserved


@pytest.mark.parametrize("program", PROGRAMS)
def test_arm_that_a_person_has_let_go_is_reserved_until_it_is_given_back(arms: Arms, program: Commander) -> None:
    arms.taken(Commander.HEADSET, "person", SOON)
    with requested_by(client="person"):
        arms.let_go(RIGHT)
    arms.clock.advance(3600.0)
    with refused(CommandRefused, "arm_reserved_for_person", arm="right", who=program.value):
        arms.taken(program, "program")
    refusal = arms.of(RIGHT).refused
    assert refusal is not None
    assert refusal.code == "arm_reserved_for_person"
    assert arms.give_back((RIGHT, LEFT)) == (RIGHT,)
    assert arms.of(RIGHT).refused is None
    assert arms.taken(program, "program")
    assert arms.give_back((RIGHT, LEFT)) == ()


def test_person_who_falls_silent_has_let_the_arm_go(arms: Arms) -> None:
    arms.taken(Commander.DEVICE, "person", SOON)
    with requested_by(client="person"):
        for _ in range(10):
            arms.clock.advance(SOON)
            arms.renew(RIGHT, SOON)
    assert arms.of(RIGHT).who is Commander.DEVICE
    arms.clock.advance(2.0 * SOON)
    assert (arms.of(RIGHT).who, arms.of(RIGHT).is_reserved) == (Commander.NONE, True)
    with requested_by(client="person"):
        arms.renew(RIGHT, SOON)  # too late
    assert arms.of(RIGHT).who is Commander.NONE
    assert arms.taken(Commander.PAGE, "another person")  # a reserved arm is for people
    assert arms.of(RIGHT).is_reserved


def test_arm_that_a_person_commands_is_not_given_back(arms: Arms) -> None:
    arms.taken(Commander.PAGE, "person")
    with refused(CommandRefused, "give_back_while_commanded", arm="right", who="page"):
        arms.give_back((RIGHT,))


def test_nobody_lets_go_what_another_one_commands(arms: Arms) -> None:
    arms.taken(Commander.DEVICE, "person")
    with requested_by(client="another"):
        arms.let_go(RIGHT)
        arms.renew(RIGHT, inf)
        assert not arms.is_own(RIGHT)
    assert arms.of(RIGHT).who is Commander.DEVICE
    arms.clock.advance(CONTROLLER_IDLE_TIME + 0.01)
    assert arms.of(RIGHT).who is Commander.NONE


def test_end_of_the_controllers_ends_the_command_and_who_takes_the_arm_next_begins_anew(arms: Arms) -> None:
    assert not arms.taken(Commander.DEVICE, "person")  # nothing was sent before
    arms.note(CommanderSilent(RIGHT, 0.2))
    assert (arms.of(RIGHT).who, arms.of(RIGHT).is_reserved) == (Commander.NONE, True)
    assert arms.taken(Commander.DEVICE, "person")
    arms.note(CommanderSilent(LEFT, 0.2))
    assert not arms.of(LEFT).is_reserved


@pytest.mark.parametrize("is_silent", [True, False])
def test_arm_was_anothers_after_a_person_has_let_it_go_or_has_fallen_silent(arms: Arms, is_silent: bool) -> None:
    arms.taken(Commander.STREAM)
    assert not arms.was_of_another(RIGHT)
    arms.taken(Commander.HEADSET, "person", SOON)
    if is_silent:
        arms.note(CommanderSilent(RIGHT, 0.2))
    arms.clock.advance(2.0 * SOON)
    arms.give_back((RIGHT,))
    assert arms.was_of_another(RIGHT)  # so that a stream does not go on from anywhere
    assert arms.taken(Commander.STREAM)
    assert not arms.was_of_another(RIGHT)


def test_hand_overs_are_events_and_a_program_that_goes_on_is_none(arms: Arms) -> None:
    arms.taken(Commander.POLICY, "policy")
    arms.clock.advance(2.0)
    arms.taken(Commander.POLICY, "policy")
    assert arms.events == []
    arms.taken(Commander.HEADSET, "person")
    with requested_by(client="person"):
        arms.let_go(RIGHT)
    arms.give_back((RIGHT,))
    arms.taken(Commander.POLICY, "policy")
    assert arms.events == [
        CommanderChanged(RIGHT, "headset", "person", "policy"),
        CommanderChanged(RIGHT, "none", "person", "headset"),
        ArmGivenBack(RIGHT),
        CommanderChanged(RIGHT, "policy", "policy", "none"),
    ]


def test_commands_that_move_pass_only_for_who_commands_and_what_only_stops_passes_always(arms: Arms) -> None:
    goal = ControllerCommand(RIGHT, "c", JointGoal(home(RIGHT), 1, None, None))
    stop = ControllerCommand(RIGHT, "c", StopMotion(2))
    end = ControllerCommand(RIGHT, "c", CancelTrajectory())
    arms.taken(Commander.DEVICE, "person")
    with arms.passing(Commands.send_commands, (end,), {}), arms.passing(Commands.hold, (RIGHT,), {}):
        pass
    with requested_by(only_holds=True), arms.passing(Commands.send_commands, (stop,), {}):
        pass
    for each in (goal, stop):  # by a stop the requester takes the arm over
        with refused(CommandRefused, "arm_commanded_by_another"), arms.passing(Commands.send_commands, (each,), {}):
            pass
    for options in ({"activate": ("c",)}, {"activate": ("c",), "deactivate": ("d",)}):
        with (
            refused(CommandRefused, "arm_commanded_by_another"),
            arms.passing(Commands.switch_controllers, (RIGHT,), options),
        ):
            pass
    with arms.passing(Commands.switch_controllers, (RIGHT, (), ("d",)), {}):  # the arm holds
        pass
    with requested_by(only_holds=True), arms.passing(Commands.switch_controllers, (RIGHT, ("c",)), {}):
        pass
    with requested_by(client="person"), arms.passing(Commands.switch_controllers, (RIGHT, ("c",)), {}):
        pass
    assert arms.of(RIGHT).who is Commander.DEVICE
    with requested_by(client="person"):
        arms.let_go(RIGHT)
    with refused(CommandRefused, "arm_reserved_for_person"), arms.passing(Commands.send_commands, (stop,), {}):
        pass


def test_program_that_is_late_switches_no_controller_of_another_program(arms: Arms) -> None:
    arms.taken(Commander.STREAM, "other")
    with (
        refused(CommandRefused, "arm_commanded_by_another"),
        arms.passing(Commands.switch_controllers, (RIGHT, ("c",)), {}),
    ):
        pass
    with arms.passing(Commands.switch_controllers, (Side.LEFT, ("c",)), {}):
        pass
    arms.clock.advance(CONTROLLER_IDLE_TIME + SOON)
    with arms.passing(Commands.switch_controllers, (RIGHT, ("c",)), {}):
        pass


@pytest.mark.parametrize("other", [*PERSONS, *PROGRAMS])
def test_arm_is_given_back_to_its_controller_unless_another_one_has_taken_it_meanwhile(
    arms: Arms, other: Commander
) -> None:
    for side in Side:
        arms.taken(Commander.TRAJECTORY, side=side)
    assert [*filter(arms.has_kept, Side)] == [*Side]
    arms.clock.advance(CONTROLLER_IDLE_TIME + SOON)
    arms.taken(other, "other")
    assert [*filter(arms.has_kept, Side)] == [LEFT]
    with requested_by(client="other"):
        arms.let_go(RIGHT)
        assert arms.has_kept(RIGHT)
    assert arms.has_kept(RIGHT) is not other.is_person


@pytest.mark.parametrize(
    "keep",
    [
        lambda arms: arms.writing((RIGHT,), Commander.STREAM),
        lambda arms: arms.switching((RIGHT,)),
        lambda arms: arms.keeping((RIGHT,)),
    ],
)
def test_who_takes_an_arm_over_waits_until_a_goal_of_before_is_written(
    arms: Arms, keep: Callable[[Arms], AbstractContextManager[None]]
) -> None:
    order: list[str] = []
    begins = Flag()

    def take() -> None:
        begins.set()
        arms.taken(Commander.DEVICE, "person")
        order.append("taken")

    other = Thread(target=take)
    with keep(arms):
        other.start()
        begins.wait()
        other.join(0.05)  # would be over by then
        assert other.is_alive()
        order.append("written")
    other.join()
    assert order == ["written", "taken"]


@pytest.mark.parametrize("taken", [RIGHT, LEFT])
def test_both_arms_are_taken_or_none(arms: Arms, taken: Side) -> None:
    arms.taken(Commander.DEVICE, "person", side=taken)
    goals = [ControllerCommand(side, "c", JointGoal(home(side), 1, None, None)) for side in Side]
    with requested_by(client="policy"):
        with refused(CommandRefused, "arm_commanded_by_another", arm=taken.word):
            arms.take_all((RIGHT, LEFT), Commander.STREAM)
        with refused(CommandRefused, "arm_commanded_by_another"), arms.writing((LEFT, RIGHT), Commander.STREAM):
            pass
        with refused(CommandRefused, "arm_commanded_by_another"), arms.passing(Commands.send_commands, goals, {}):
            pass
    assert arms.of(taken.other).who is Commander.NONE
    with requested_by(client="person"):
        arms.let_go(taken)
    arms.give_back((taken,))
    with requested_by(client="policy"), arms.writing((LEFT, RIGHT), Commander.STREAM):
        assert {arms.of(side).who for side in Side} == {Commander.STREAM}


def test_those_who_write_for_both_arms_in_any_order_do_not_wait_for_each_other(arms: Arms) -> None:
    def write(*sides: Side) -> None:
        for _ in range(200):
            with arms.writing(sides, Commander.STREAM):
                pass

    threads = [Thread(target=write, args=each, daemon=True) for each in ((RIGHT, LEFT), (LEFT, RIGHT), (LEFT,))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(5.0)
        assert not thread.is_alive()


def test_chunk_of_a_policy_takes_its_arm_and_no_chunk_passes_while_another_one_commands(arms: Arms) -> None:
    spline = plan_chunk(RIGHT, [0.0, 0.1], np.array([home(RIGHT), home(RIGHT)]), YUMI_LIMITS)
    chunk = ControllerCommand(RIGHT, "c", FollowChunk(1, 0.0, spline))
    with requested_by(client="policy"), arms.passing(Commands.take_commands, (chunk,), {}):
        pass
    assert arms.of(RIGHT).who is Commander.POLICY
    arms.taken(Commander.DEVICE, "person")
    with (
        requested_by(client="policy"),
        refused(CommandRefused, "arm_commanded_by_another"),
        arms.passing(Commands.take_commands, (chunk,), {}),
    ):
        pass


@pytest.mark.parametrize("who", [Commander.PAGE, Commander.TRAJECTORY])
def test_command_that_the_controller_refuses_takes_no_arm(arms: Arms, who: Commander) -> None:
    goal = ControllerCommand(RIGHT, "c", JointGoal(home(RIGHT)))
    if who.is_person:
        arms.taken(Commander.STREAM, "program")
    before = arms.of(RIGHT)
    with (
        requested_by(who, "other", "other"),
        refused(CommandRefused, "arm_without_egm"),
        arms.passing(Commands.send_commands, (goal,), {}),
    ):
        raise CommandRefused(message("arm_without_egm", arm="right"))
    assert arms.of(RIGHT) == before
    with requested_by(who, "other", "other"), arms.passing(Commands.send_commands, (goal,), {}):
        assert arms.of(RIGHT) == before
    assert arms.of(RIGHT).who is who


def test_command_without_an_answer_in_time_takes_its_arm_as_it_may_be_carried_out(arms: Arms) -> None:
    goal = ControllerCommand(RIGHT, "c", JointGoal(home(RIGHT)))
    with (
        requested_by(Commander.PAGE, "page", "page"),
        refused(RobotNotReady, "control_process_does_not_answer"),
        arms.passing(Commands.send_commands, (goal,), {}),
    ):
        raise RobotNotReady(message("control_process_does_not_answer", timeout=5.0))
    assert arms.of(RIGHT).who is Commander.PAGE


def test_blend_begins_where_the_arm_is_sent_and_ends_on_the_stream() -> None:
    sent, first = rad((20, -90, -110, 10, 30, 60, 10)), rad((30, -80, -100, 20, 40, 50, 0))
    blend = StreamBegin(sent, first, 2.0)
    assert blend.at(first, 0.0)[0] == blend.at(first, -1.0)[0] == pytest.approx(sent)
    assert blend.at(first, 2.0) == (first, ZERO_JOINTS)
    half = joints([0.5 * (a + b) for a, b in zip(sent, first, strict=True)])
    assert blend.at(first, 1.0)[0] == pytest.approx(half)
    step = 1e-3
    for time in (0.0, 2.0 - 2.0 * step):  # neither speed nor acceleration steps where it begins and ends
        a, b, c = (blend.at(first, time + number * step)[0][0] for number in range(3))
        assert abs(b - a) / step < 1e-5
        assert abs(c - 2.0 * b + a) / step**2 < 2e-2
    assert StreamBegin(sent, first, 0.0).at(ZERO_JOINTS, 0.0) == (ZERO_JOINTS, ZERO_JOINTS)


def test_velocity_of_a_blended_point_is_that_of_the_blended_positions() -> None:
    sent, speed = rad((20, -90, -110, 10, 30, 60, 10)), joints([0.1 * number for number in range(7)])
    blend, step = StreamBegin(sent, ZERO_JOINTS, 2.0), 1e-4

    def position(time: float) -> Joints:
        return blend.at(joints([each * time for each in speed]), time)[0]

    for time in (0.2, 1.0, 1.7):
        _, velocity = blend.at(joints([each * time for each in speed]), time, speed)
        rows = zip(position(time - step), position(time + step), strict=True)
        assert velocity == pytest.approx([(after - before) / (2.0 * step) for before, after in rows], abs=1e-6)
    assert all(map(isnan, blend.at(ZERO_JOINTS, 1.0, UNKNOWN_JOINTS)[1]))
