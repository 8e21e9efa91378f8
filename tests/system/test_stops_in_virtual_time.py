"""After an emergency stop, a guard stop or a collision nothing moves before a person has confirmed that stop."""

from __future__ import annotations

from collections.abc import Callable
from math import radians

import pytest

from abb_protocols.catalogue import message
from abb_protocols.errors import NoConnection, RobotNotReady, StopNotConfirmed, YumiError
from abb_protocols.robot.joints import Joints, Side, joints
from abb_protocols.rws.values import ControllerState, EventType, ExecutionState
from abb_runtime.faults import Fault
from refusals import assert_says, numbers_in, refused
from system.recovery_bench import GOALS, MovingSystem
from system.virtual_time_bench import System
from yumi.driver.commissioning.stream_checks import streaming
from yumi.driver.robot_state import RobotMode
from yumi.driver.stops import STOP_HISTORY

NO_JUMP = 1.001
NUMBERS = {Fault.COLLISION: 50204, Fault.EMERGENCY_STOP: 10013}
MEETING: dict[Side, Joints] = {
    Side.RIGHT: joints([radians(each) for each in (107, -111, -76, 39, -166, 113, -128)]),
    Side.LEFT: joints([radians(each) for each in (-106, -105, 78, 38, 161, 111, 124)]),
}
APART = joints([radians(each) for each in (-76, -104, 79, 24, 102, 102, 94)])
REQUESTS: dict[str, Callable[[System], object]] = {
    "recover": lambda system: system.manager.recover(print),
    "start_egm": lambda system: system.manager.start_egm(),
    "set_mode egm_left": lambda system: system.manager.go_to(RobotMode.EGM_LEFT, print),
    "set_mode ready": lambda system: system.manager.go_to(RobotMode.READY, print),
    "make_ready": lambda system: system.manager.make_ready(),
    "motors_on": lambda system: system.manager.motors_on(),
    "start_rapid": lambda system: system.manager.start_rapid(),
    "write_signal": lambda system: system.manager.write_signal("EGM_START_JOINT", 1),
    "write_signal of a routine": lambda system: system.manager.write_signal("EtherNetIP/local/Run_RAPID_routine", 1),
    "write_signal of fingers": lambda system: system.manager.write_signal("hand_CmdGripper_R", 2),
    "write_signal of fingers on a device": lambda system: system.manager.write_signal("a/b/HAND_CmdGripper_L", "1"),
    "run_routine": lambda system: system.manager.run_routine(Side.LEFT, "runMoveJ"),
}


@pytest.fixture
def system() -> MovingSystem:
    return MovingSystem()


def stop(system: System, fault: Fault) -> None:
    """It happens; a button that was pressed is released again."""
    system.faults.inject(fault)
    system.wait(0.3)
    if fault is Fault.EMERGENCY_STOP:
        system.faults.inject(Fault.EMERGENCY_STOP_RESET)
    system.wait(0.3)


def positions(system: System) -> list[Joints]:
    return [arm.position for arm in system.world.arms.values()]


def seen(system: System) -> tuple[object, ...]:
    controller = system.world.controller
    return controller.controller_state, controller.is_running, len(controller.events.entries()), positions(system)


@pytest.fixture(scope="module", params=NUMBERS)
def stopped(request: pytest.FixtureRequest) -> tuple[MovingSystem, Fault]:
    """A system that a person stopped, and how; for all requests, since none of them changes it."""
    system = MovingSystem()
    stop(system, request.param)
    return system, request.param


@pytest.mark.parametrize("request_", REQUESTS.values(), ids=list(REQUESTS))
def test_nothing_starts_after_a_persons_stop_without_confirmation(
    stopped: tuple[MovingSystem, Fault], request_: Callable[[System], object]
) -> None:
    system, fault = stopped
    before = seen(system)
    with refused(StopNotConfirmed, "stopped_by", stop=system.stop_id()) as refusal:
        request_(system)
    assert numbers_in(refusal.value.said) == {NUMBERS[fault]}
    system.wait(0.5)
    assert seen(system) == before


def test_nothing_is_started_for_a_test_of_the_streams_after_a_persons_stop(
    stopped: tuple[MovingSystem, Fault],
) -> None:
    """As `yumi doctor --stream` does, which has no driver; one that comes later still has to see the stop."""
    system, fault = stopped
    before = seen(system)
    with refused(RobotNotReady, "stop_before_installation") as refusal, streaming(system.client, system):
        pass
    assert numbers_in(refusal.value.said) == {NUMBERS[fault]}
    assert seen(system) == before
    system.start_driver()
    with pytest.raises(StopNotConfirmed):
        system.manager.make_ready()


@pytest.mark.parametrize("fault", NUMBERS)
def test_confirmed_robot_stands_until_it_gets_a_new_goal(system: MovingSystem, fault: Fault) -> None:
    stop(system, fault)
    before = positions(system)
    assert str(NUMBERS[fault]) in system.recover_by_person()
    system.wait(1.0)
    for now, then in zip(positions(system), before, strict=True):
        assert now == pytest.approx(then, abs=1e-4)
    assert system.manager.state().stop == ""
    assert system.is_moving_again()
    assert system.largest_jump < NO_JUMP


def test_arms_that_nothing_keeps_apart_meet_and_go_back_after_a_confirmation(system: MovingSystem) -> None:
    """The limiter of this system does not know the arms' shapes."""
    system.until(lambda: all(system.is_near(side, goal) for side, goal in GOALS.items()), 4.0)
    system.go(MEETING)
    system.until(lambda: not system.world.controller.is_running, 6.0)
    system.wait(0.3)
    state = system.manager.state()
    assert [each.code for each in state.causes] == ["event_50204_with_detail"]
    assert "has met the" in state.causes[0].values["detail"]  # the virtual controller's own text
    system.recover(state.stop)
    system.go({Side.LEFT: APART})
    system.until(lambda: system.is_near(Side.LEFT, APART), 6.0)
    assert system.world.controller.is_running


def test_goals_given_while_the_stop_was_open_are_dropped(system: MovingSystem) -> None:
    stop(system, Fault.COLLISION)
    before = positions(system)
    system.go({side: tuple(0.9 * value for value in arm.snapshot.position) for side, arm in system.arms.items()})  # type: ignore[misc]
    system.recover_by_person()
    system.wait(1.0)
    for now, then in zip(positions(system), before, strict=True):
        assert now == pytest.approx(then, abs=1e-4)


def test_confirmation_of_another_stop_is_refused_with_the_stop_that_is_open(system: MovingSystem) -> None:
    stop(system, Fault.COLLISION)
    old = system.stop_id()
    system.recover(old)
    stop(system, Fault.COLLISION)
    new = system.stop_id()
    with refused(StopNotConfirmed, "another_stop_open", given=old) as refusal:
        system.recover(old)
    assert_says(refusal.value.said.values["open"], "stopped_by", stop=new)
    assert refusal.value.stop == new
    assert system.world.controller.is_running is False


def test_id_of_a_stop_is_random_and_names_its_event() -> None:
    ids = []
    for _ in range(2):
        system = MovingSystem()
        stop(system, Fault.COLLISION)
        ids.append(system.stop_id())
    (first, second) = (each.split("-") for each in ids)
    assert first[:2] == second[:2]
    assert first[0] == "50204"
    assert first[2] != second[2]


def test_confirmation_while_the_button_is_pressed_does_not_count(system: MovingSystem) -> None:
    system.faults.inject(Fault.EMERGENCY_STOP)
    system.wait(0.2)
    identity = system.stop_id()
    with refused(StopNotConfirmed, "still_stopped", stop=identity, reason=message("emergency_stop_pressed")):
        system.recover(identity)
    system.faults.inject(Fault.EMERGENCY_STOP_RESET)
    system.wait(1.0)
    assert system.world.controller.controller_state is ControllerState.EMERGENCY_STOP_RESET
    with pytest.raises(StopNotConfirmed):
        system.recover()
    system.recover(identity)
    assert system.is_moving_again()


def test_stop_that_comes_while_the_robot_is_brought_back_ends_that(system: MovingSystem) -> None:
    stop(system, Fault.COLLISION)
    identity = system.stop_id()

    def report(step: str) -> None:
        if step == "move the program pointers to main":
            system.faults.inject(Fault.COLLISION, Side.RIGHT)

    with refused(StopNotConfirmed, "another_stop_open", given=identity):
        system.manager.recover(report, confirmed=identity)
    assert system.client.execution() is ExecutionState.STOPPED
    assert system.stop_id() != identity


@pytest.mark.parametrize("is_asked", [True, False], ids=["asked", "controller does not answer"])
def test_stop_that_makes_a_step_fail_is_reported_with_its_own_id_and_cause(
    system: MovingSystem, monkeypatch: pytest.MonkeyPatch, is_asked: bool
) -> None:
    stop(system, Fault.EMERGENCY_STOP)
    identity = system.stop_id()

    def lose_connection(**_: object) -> None:
        raise NoConnection("No answer.")

    def collide(_: float) -> None:
        system.faults.inject(Fault.COLLISION)
        if not is_asked:
            system.manager.monitor.read()
            monkeypatch.setattr(system.client, "events", lose_connection)
        raise RobotNotReady("The left arm did not become idle.")

    monkeypatch.setattr(system.bringup.machines, "wait_for_idle", collide)
    with pytest.raises(RobotNotReady) as refusal:
        system.recover(identity)
    assert 50204 in numbers_in(refusal.value.said)
    assert refusal.value.stop not in ("", identity)
    assert refusal.value.stop in str(refusal.value)
    assert isinstance(refusal.value, StopNotConfirmed) is is_asked


def test_step_that_fails_without_another_stop_is_reported_with_the_id_that_is_still_open(
    system: MovingSystem, monkeypatch: pytest.MonkeyPatch
) -> None:
    stop(system, Fault.EMERGENCY_STOP)
    identity = system.stop_id()

    def fail(_: float) -> None:
        raise RobotNotReady("The left arm did not become idle.")

    monkeypatch.setattr(system.bringup.machines, "wait_for_idle", fail)
    with refused(RobotNotReady, "not_brought_back_after_stop", stop=identity) as refusal:
        system.recover(identity)
    assert numbers_in(refusal.value.said) == {10013}
    assert refusal.value.stop == identity


@pytest.mark.parametrize("is_pressed", [True, False])
def test_every_refusal_with_the_id_of_a_stop_names_it(system: MovingSystem, is_pressed: bool) -> None:
    system.faults.inject(Fault.EMERGENCY_STOP)
    system.wait(0.3)
    if not is_pressed:
        system.faults.inject(Fault.EMERGENCY_STOP_RESET)
        system.wait(0.3)
    requests = [*REQUESTS.values(), lambda system: system.manager.check_not_stopped()]
    if is_pressed:
        identity = system.stop_id()
        requests.append(lambda system: system.recover(identity))
    for request in requests:
        with pytest.raises(RobotNotReady) as refusal:
            request(system)
        assert refusal.value.stop
        assert refusal.value.stop in str(refusal.value)


def test_stop_that_another_thread_has_noticed_ends_what_is_being_done(system: MovingSystem) -> None:
    stop(system, Fault.COLLISION)
    identity = system.stop_id()

    def report(step: str) -> None:
        if step == "move the program pointers to main":
            system.faults.inject(Fault.COLLISION, Side.RIGHT)
            system.manager.monitor.read()

    with refused(StopNotConfirmed, "another_stop_open", given=identity):
        system.manager.recover(report, confirmed=identity)
    assert system.client.execution() is ExecutionState.STOPPED


def test_guard_stop_of_the_mode_switch_is_confirmed_at_the_flexpendant(system: MovingSystem) -> None:
    system.faults.inject(Fault.MANUAL_MODE)
    system.world.controller.events.append(10012, "Guard stop state", "The enabling device was released.")
    system.wait(0.2)
    assert system.manager.state().stop.startswith("10012-")
    system.faults.inject(Fault.AUTO_MODE)
    system.wait(0.2)
    assert system.manager.state().stop == ""
    system.recover()
    assert system.is_moving_again()


def test_emergency_stop_before_the_mode_switch_still_waits_for_confirmation(system: MovingSystem) -> None:
    stop(system, Fault.EMERGENCY_STOP)
    system.faults.inject(Fault.MANUAL_MODE)
    system.faults.inject(Fault.AUTO_MODE)
    system.wait(0.2)
    with pytest.raises(StopNotConfirmed, match="10013"):
        system.recover()


def test_stop_that_comes_while_egm_is_started_ends_that(system: MovingSystem) -> None:
    system.manager.stop_egm()
    system.client.stop_rapid()
    system.bringup._reports.append(
        lambda step: system.faults.inject(Fault.COLLISION) if step == "move the program pointers to main" else None
    )
    with refused(StopNotConfirmed, "stopped_by") as refusal:
        system.manager.start_egm()
    assert numbers_in(refusal.value.said) == {50204}
    assert system.client.execution() is ExecutionState.STOPPED


def test_guard_stop_waits_for_confirmation_when_the_guard_is_closed() -> None:
    system = MovingSystem()
    controller = system.world.controller
    system.faults.inject(Fault.MOTORS_OFF)
    controller.controller_state = ControllerState.GUARD_STOP
    controller.events.append(10012, "Guard stop state", "The guard was opened.")
    system.wait(0.2)
    with pytest.raises(StopNotConfirmed) as refusal:
        system.recover()
    assert numbers_in(refusal.value.said) == {10012}
    controller.controller_state = ControllerState.MOTORS_OFF  # closing the guard
    system.wait(0.2)
    system.recover_by_person()
    assert system.is_moving_again()


def test_state_alone_is_a_stop_where_the_event_log_was_cleared(system: MovingSystem) -> None:
    stop(system, Fault.EMERGENCY_STOP)
    system.client.clear_events()
    with pytest.raises(StopNotConfirmed) as refusal:
        system.manager.motors_on()
    assert numbers_in(refusal.value.said) == {10013}
    system.recover_by_person()
    assert system.is_moving_again()


def state_only(system: MovingSystem) -> str:
    """An emergency stop whose event nobody can read any more; its id."""
    stop(system, Fault.EMERGENCY_STOP)
    system.client.clear_events()
    identity = system.stop_id()
    assert identity.startswith("10013-0-")
    return identity


def test_event_that_follows_its_state_soon_keeps_the_id_of_the_stop(system: MovingSystem) -> None:
    identity = state_only(system)
    system.world.controller.events.append(10013, "Emergency stop", "Late.", EventType.ERROR)
    system.wait(0.2)
    assert system.manager.state().stop == identity


def test_emergency_stop_that_comes_later_than_one_known_by_the_state_has_another_id(system: MovingSystem) -> None:
    identity = state_only(system)
    system.wait(STOP_HISTORY)
    stop(system, Fault.EMERGENCY_STOP)
    with refused(StopNotConfirmed, "another_stop_open", given=identity):
        system.recover(identity)


def test_emergency_stop_while_one_known_by_the_state_is_recovered_ends_that(system: MovingSystem) -> None:
    identity, steps = state_only(system), list[str]()

    def report(step: str) -> None:
        steps.append(step)
        if len(steps) == 1:  # what stopped the robot
            system.faults.inject(Fault.EMERGENCY_STOP)
            system.faults.inject(Fault.EMERGENCY_STOP_RESET)

    with refused(StopNotConfirmed, "another_stop_open", given=identity):
        system.manager.recover(report, confirmed=identity)
    assert system.client.controller_state() is not ControllerState.MOTORS_ON


def test_driver_that_starts_at_a_stopped_robot_waits_for_confirmation(system: MovingSystem) -> None:
    stop(system, Fault.COLLISION)
    system.start_driver()
    with pytest.raises(StopNotConfirmed, match="50204") as refusal:
        system.manager.make_ready()
    assert system.client.execution() is ExecutionState.STOPPED
    assert system.manager.make_ready(refusal.value.stop) == "The robot is ready"
    system.manager.start_egm()


def test_stop_before_the_last_start_of_the_program_is_history_for_a_new_driver(system: MovingSystem) -> None:
    stop(system, Fault.COLLISION)
    system.recover_by_person()
    system.start_driver()
    assert system.manager.start_egm().startswith("EGM runs on both arms")


def test_program_that_another_client_starts_confirms_nothing_for_a_driver_that_saw_the_stop(
    system: MovingSystem,
) -> None:
    stop(system, Fault.COLLISION)
    system.client.start_rapid()
    system.wait(0.2)
    with refused(StopNotConfirmed, "stopped_by") as refusal:
        system.manager.start_egm()
    assert numbers_in(refusal.value.said) == {50204}


def test_several_stops_are_reported_together_and_confirmed_by_the_newest(system: MovingSystem) -> None:
    stop(system, Fault.COLLISION)
    first = system.stop_id()
    stop(system, Fault.EMERGENCY_STOP)
    with pytest.raises(StopNotConfirmed) as refusal:
        system.recover(first)
    assert numbers_in(refusal.value.said) == {50204, 10013}
    system.recover_by_person()
    assert system.is_moving_again()


def test_event_log_that_cannot_be_read_starts_nothing(system: MovingSystem, monkeypatch: pytest.MonkeyPatch) -> None:
    stop(system, Fault.PROGRAM_STOP)

    def refuse(**_: object) -> None:
        raise RobotNotReady("The event log cannot be read.")

    monkeypatch.setattr(system.client, "events", refuse)
    for request in REQUESTS.values():
        with pytest.raises(YumiError):
            request(system)
    assert system.client.execution() is ExecutionState.STOPPED


def test_many_events_after_a_collision_do_not_hide_it(system: MovingSystem) -> None:
    stop(system, Fault.COLLISION)
    for percent in range(80):
        system.world.controller.set_speed_ratio(percent)
    with refused(StopNotConfirmed, "stopped_by") as refusal:
        system.manager.start_egm()
    assert numbers_in(refusal.value.said) == {50204}


def test_state_reports_the_stop_and_its_cause(system: MovingSystem) -> None:
    assert (system.manager.state().causes, system.manager.state().stop) == ((), "")
    stop(system, Fault.EMERGENCY_STOP)
    state = system.manager.state()
    assert [each.values["number"] for each in state.causes] == [10013]
    assert state.stop.startswith("10013-")
    assert state.reasons == (message("stop_open", stop=state.stop),)
    said = {"reasons": state.reasons, "causes": state.causes}
    with refused(RobotNotReady, "not_ready_after_stop", **said) as refusal:
        system.manager.check_ready()
    assert refusal.value.stop == state.stop


@pytest.mark.parametrize(
    ("fault", "cause"),
    [
        (Fault.PROGRAM_STOP, "event_10125"),
        (Fault.MOTORS_OFF, "event_10010"),
        (Fault.MANUAL_MODE, "event_10015"),
    ],
)
def test_state_reports_the_cause_of_a_stop_that_needs_no_confirmation(
    system: MovingSystem, fault: Fault, cause: str
) -> None:
    stop(system, fault)
    state = system.manager.state()
    assert [each.code for each in state.causes] == [cause]
    assert state.stop == ""


def test_motors_go_off_and_motion_ends_while_a_stop_is_open(system: MovingSystem) -> None:
    stop(system, Fault.COLLISION)
    assert system.manager.stop_egm()
    assert system.manager.motors_off() == "The motors are off"


def test_stop_soon_after_egm_was_started_again_is_not_explained_by_what_had_ended_it(system: MovingSystem) -> None:
    system.manager.start_egm()
    system.faults.inject(Fault.COMM_TIMEOUT)
    system.until(lambda: not system.control.snapshot(Side.RIGHT).is_running, 2.0)
    system.manager.start_egm()
    system.faults.inject(Fault.PROGRAM_STOP)
    system.wait(0.3)
    assert [each.code for each in system.manager.state().causes] == ["event_10125"]
