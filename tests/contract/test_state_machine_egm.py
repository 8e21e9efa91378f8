"""EGM through the state machine, as a client that pulses signals and reads variables meets it."""

import pytest
from state_machine_bench import ARMS, Bench

from abb_protocols.egm.codec import MciState, MotorState, RapidState
from abb_protocols.robot.joints import Joints, Side, home


@pytest.fixture
def bench() -> Bench:
    bench = Bench()
    bench.bring_up()
    return bench


@pytest.fixture
def guided(bench: Bench) -> Bench:
    """EGM runs on both arms, fast and with a second of silence allowed."""
    bench.set_egm("activate.max_speed_deviation", "400")
    bench.set_egm("run.ramp_in_time", "0.1")
    bench.pulse("EGM_START_JOINT")
    bench.run_until(lambda: all(bench.sensors[side].heard for side in ARMS), limit=1.0)
    return bench


def bent(side: Side, by: float = 0.1) -> Joints:
    """Home with the last joint turned [rad]."""
    *others, last = home(side)
    a, b, c, d, e, f = others
    return (a, b, c, d, e, f, last + by)


def test_start_joint_is_visible_in_the_next_read(bench: Bench) -> None:
    bench.pulse("EGM_START_JOINT")
    assert (bench.states, bench.actions) == ((3, 3), (1, 1))


def test_both_arms_begin_to_send_with_number_0(guided: Bench) -> None:
    guided.run(0.1)
    for side in ARMS:
        assert [message.seqno for message in guided.sensors[side].heard[:5]] == [0, 1, 2, 3, 4]


def test_first_datagram_is_complete_and_running(guided: Bench) -> None:
    for side in ARMS:
        first = guided.sensors[side].heard[0]
        assert (first.motors, first.mci, first.rapid) == (MotorState.ON, MciState.RUNNING, RapidState.RUNNING)
        assert first.measured == pytest.approx(home(side), abs=1e-6)


def test_arms_follow_their_references(guided: Bench) -> None:
    for side in ARMS:
        guided.sensors[side].goal = bent(side)
    guided.run(3.0)
    for side in ARMS:
        assert guided.world.arms[side].position == pytest.approx(bent(side), abs=1e-4)


def test_default_settings_let_the_arm_crawl_at_one_degree_per_second(bench: Bench) -> None:
    bench.pulse("EGM_START_JOINT")
    bench.sensors[Side.LEFT].goal = bent(Side.LEFT, by=1.0)
    bench.run_until(lambda: bool(bench.sensors[Side.LEFT].heard), limit=1.0)
    bench.run(3.0)
    moved = bench.world.arms[Side.LEFT].position[6] - home(Side.LEFT)[6]
    assert 0.02 < moved < 3.0 * 0.01746


def test_stop_returns_both_arms_to_idle(guided: Bench) -> None:
    guided.pulse("EGM_STOP")
    assert (guided.states, guided.actions) == ((3, 3), (3, 3))
    guided.run_until(lambda: guided.states == (0, 0), limit=1.0)
    assert guided.actions == (0, 0)


def test_stop_ends_the_datagrams(guided: Bench) -> None:
    guided.pulse("EGM_STOP")
    guided.run(0.1)
    heard = [len(guided.sensors[side].heard) for side in ARMS]
    guided.run(0.1)
    assert [len(guided.sensors[side].heard) for side in ARMS] == heard
    assert guided.sensors[Side.LEFT].heard[-1].mci is MciState.STOPPED


def test_stop_in_full_motion_holds_the_arm_where_it_comes_to_rest(guided: Bench) -> None:
    guided.sensors[Side.RIGHT].goal = bent(Side.RIGHT, by=1.0)
    guided.run(0.3)
    guided.pulse("EGM_STOP")
    guided.run_until(lambda: guided.states == (0, 0), limit=2.0)
    position = guided.world.arms[Side.RIGHT].position
    guided.run(0.2)
    assert guided.world.arms[Side.RIGHT].position == pytest.approx(position, abs=1e-5)


def test_second_session_begins_with_number_0_again(guided: Bench) -> None:
    guided.pulse("EGM_STOP")
    guided.run_until(lambda: guided.states == (0, 0), limit=1.0)
    guided.sensors[Side.LEFT].heard.clear()
    guided.pulse("EGM_START_JOINT")
    guided.run_until(lambda: bool(guided.sensors[Side.LEFT].heard), limit=1.0)
    assert guided.sensors[Side.LEFT].heard[0].seqno == 0


def test_silent_sensor_ends_egm_with_a_message(guided: Bench) -> None:
    guided.sensors[Side.LEFT].is_silent = True
    guided.run_until(lambda: guided.states[1] == 0, limit=4.0)
    assert guided.actions[1] == 0
    assert "[EGM]: Communication timed out" in guided.screen(Side.LEFT)
    assert guided.controller.events.entries()[0].code == 41822


def test_silent_sensor_of_one_arm_leaves_the_other_arm_running(guided: Bench) -> None:
    guided.sensors[Side.LEFT].is_silent = True
    guided.run_until(lambda: guided.states[1] == 0, limit=4.0)
    assert (guided.states[0], guided.actions[0]) == (3, 1)
    assert guided.controller.is_running


def test_egm_starts_again_after_a_timeout(guided: Bench) -> None:
    for side in ARMS:
        guided.sensors[side].is_silent = True
    guided.run_until(lambda: guided.states == (0, 0), limit=4.0)
    for side in ARMS:
        guided.sensors[side].is_silent = False
    guided.pulse("EGM_START_JOINT")
    guided.run(1.5)
    assert (guided.states, guided.actions) == ((3, 3), (1, 1))


def test_convergence_ends_egm_after_cond_time(bench: Bench) -> None:
    bench.set_egm("run.cond_time", "0.5")
    bench.pulse("EGM_START_JOINT")
    bench.run(0.4)
    assert bench.states == (3, 3)
    bench.run_until(lambda: bench.states == (0, 0), limit=1.0)


def test_arm_that_is_not_allowed_stays_idle(bench: Bench) -> None:
    bench.set_egm("allow_egm_motions", "FALSE", sides=(Side.LEFT,))
    bench.pulse("EGM_START_JOINT")
    assert (bench.states, bench.actions) == ((3, 0), (1, 0))


def test_pose_motion_is_not_available_on_seven_axes(bench: Bench) -> None:
    bench.pulse("EGM_START_POSE")
    bench.run_until(lambda: (bench.states, bench.actions) == ((0, 0), (0, 0)), limit=0.1)
    assert bench.screen(Side.RIGHT)[-1] == "[EGM]: Pose motion is not available for IRB 14000"


def test_pose_motion_is_not_even_tried_where_motions_are_not_allowed(bench: Bench) -> None:
    bench.set_egm("allow_egm_motions", "FALSE")
    lines = bench.screen(Side.RIGHT)
    bench.pulse("EGM_START_POSE")
    assert bench.screen(Side.RIGHT) == lines


def test_stream_goes_on_in_idle_and_ignores_replies(bench: Bench) -> None:
    bench.sensors[Side.RIGHT].goal = bent(Side.RIGHT)
    bench.pulse("EGM_START_STREAM")
    bench.run(0.5)
    assert (bench.states, bench.actions) == ((0, 0), (4, 4))
    assert bench.sensors[Side.RIGHT].heard[-1].mci is MciState.STOPPED
    assert bench.world.arms[Side.RIGHT].position == pytest.approx(home(Side.RIGHT), abs=1e-6)


def test_stream_stops_on_request(bench: Bench) -> None:
    bench.pulse("EGM_START_STREAM")
    bench.run(0.2)
    bench.pulse("EGM_STOP_STREAM")
    bench.run_until(lambda: (bench.states, bench.actions) == ((0, 0), (0, 0)), limit=0.1)
    bench.run(0.02)
    heard = len(bench.sensors[Side.RIGHT].heard)
    bench.run(0.1)
    assert len(bench.sensors[Side.RIGHT].heard) == heard


def test_presynchronized_arms_start_in_the_same_cycle(bench: Bench) -> None:
    bench.set_egm("use_presync", "TRUE")
    bench.pulse("EGM_START_JOINT")
    bench.run(0.5)
    assert len(bench.sensors[Side.LEFT].heard) == len(bench.sensors[Side.RIGHT].heard) > 0


def test_presync_gives_up_when_the_other_arm_may_not_move(bench: Bench) -> None:
    bench.set_egm("use_presync", "TRUE")
    bench.set_egm("allow_egm_motions", "FALSE", sides=(Side.LEFT,))
    bench.pulse("EGM_START_JOINT")
    bench.run_until(lambda: bench.states == (0, 0), limit=11.0)
    assert "[EGM]: Pre-synchronization timed out" in bench.screen(Side.RIGHT)


def test_reference_beyond_a_limit_switches_the_motors_off(guided: Bench) -> None:
    guided.sensors[Side.LEFT].goal = bent(Side.LEFT, by=9.0)
    guided.run(0.2)
    assert guided.controller.controller_state.value == "motoroff"
    assert not guided.controller.is_running
    assert not any(arm.motors_on for arm in guided.world.arms.values())


@pytest.mark.parametrize(
    ("field", "written", "used"),
    [
        ("activate.sample_rate", "11", "8"),
        ("activate.sample_rate", "3", "4"),
        ("activate.sample_rate", "4.4", "4"),
        ("run.pos_corr_gain", "5", "1"),
        ("run.pos_corr_gain", "-1", "0"),
        ("stop.ramp_out_time", "-2", "2"),
        ("activate.cond_min_max", "-0.7", "-0.7"),
    ],
)
def test_settings_are_brought_into_range_and_written_back(bench: Bench, field: str, written: str, used: str) -> None:
    bench.set_egm(field, written)
    bench.pulse("EGM_START_JOINT")
    bench.run(0.1)
    for side in ARMS:
        assert bench.egm_setting(side, field) == used


def test_sample_rate_of_8_ms_halves_the_datagrams(bench: Bench) -> None:
    bench.set_egm("activate.sample_rate", "8")
    bench.pulse("EGM_START_JOINT")
    bench.run_until(lambda: bool(bench.sensors[Side.LEFT].heard), limit=1.0)
    before = len(bench.sensors[Side.LEFT].heard)
    bench.run(0.4032)
    assert len(bench.sensors[Side.LEFT].heard) - before == 50


def test_default_settings_read_as_the_add_in_writes_them(bench: Bench) -> None:
    frame = "[[0,0,0],[1,0,0,0]]"
    tool = f"[TRUE,{frame},[0.001,[0,0,0.001],[1,0,0,0],0,0,0]]"
    wobj = f'[FALSE,TRUE,"",{frame},{frame}]'
    activate = f"[{tool},{wobj},{frame},{frame},0.5,20,4,1]"
    assert bench.read(Side.LEFT, "TRobEGM", "settings") == f"[TRUE,FALSE,[TRUE,1],{activate},[60,1,{frame},1],[1]]"
