"""EGM instructions: their checks, and how a run ends for the program."""

from math import hypot, radians

import numpy as np
import pytest
from instruction_bench import InstructionBench

from abb_protocols.egm.codec import MciState, SensorCodec, SensorMessage
from abb_protocols.robot.joints import Side, home
from abb_protocols.rws.values import SignalType
from virtual_irc5.controller.signals import ControllerSignal
from virtual_irc5.instructions.robot_data import jointtarget
from virtual_irc5.mechanics.egm_client import EgmClientState, EgmOutcome
from virtual_irc5.mechanics.egm_motion import EgmActivation

MOVE = "MoveAbsJ CJointT(),v100,fine,tool0; "
SETUP = 'EGMGetId egm; EGMSetupUC ROB_ID,egm,"ROB_R","ROB_R"\\Joint\\CommTimeout:=0.5; '
ACT = "EGMActJoint egm\\Tool:=my_tool\\J1:=[-0.1,0.1]\\MaxSpeedDeviation:=100; "
RUN = "EGMRunJoint egm,EGM_STOP_HOLD\\J1\\J2\\J3\\J4\\J5\\J6\\J7\\CondTime:=0.2\\PosCorrGain:=1; "


@pytest.fixture
def bench() -> InstructionBench:
    return InstructionBench()


def guide(bench: InstructionBench, limit: float = 5.0) -> None:
    """Answer every datagram with home, until the program ends."""
    codec = SensorCodec()
    while bench.task.is_running and bench.task.now < limit:
        if bench.sent:
            bench.inbox = [codec.encode(SensorMessage(0, home(Side.RIGHT)))]
        bench.step()


def test_run_returns_after_convergence(bench: InstructionBench) -> None:
    bench.start(MOVE + SETUP + ACT + RUN + "number:=EGMGetState(egm);")
    guide(bench)
    assert bench.failure == ""
    assert float(bench.read("number")) == EgmClientState.CONNECTED
    assert 0.2 < bench.task.now < 0.5


def test_silent_sensor_raises_an_error_the_program_can_handle(bench: InstructionBench) -> None:
    bench.run(MOVE + SETUP + ACT + RUN + 'ERROR IF ERRNO=ERR_UDPUC_COMM text:="timed out"; RETURN;')
    assert bench.read("text") == '"timed out"'
    assert [event.code for event in bench.events.entries()] == [41822]


def test_run_without_handler_stops_the_program_when_the_sensor_is_silent(bench: InstructionBench) -> None:
    bench.run(MOVE + SETUP + ACT + RUN)
    assert "ERR_UDPUC_COMM" in bench.failure
    assert "No datagram has come for 0.5 s" in bench.failure


def test_run_without_waiting_goes_on_in_the_program(bench: InstructionBench) -> None:
    start = RUN.replace("HOLD", "HOLD\\NoWaitCond")
    bench.start(MOVE + SETUP + ACT + start + "number:=EGMGetState(egm); EGMWaitCond egm; flag:=TRUE;")
    guide(bench)
    assert float(bench.read("number")) == EgmClientState.RUNNING
    assert bench.read("flag") == "TRUE"


def test_wait_needs_a_run(bench: InstructionBench) -> None:
    bench.run(SETUP + "EGMWaitCond egm;")
    assert "EGMWaitCond: there was no EGMRunJoint to wait for" in bench.failure


def test_silent_sensor_is_fatal_when_the_program_did_not_wait(bench: InstructionBench) -> None:
    start = RUN.replace("HOLD", "HOLD\\NoWaitCond")
    bench.run(MOVE + SETUP + ACT + start + 'EGMWaitCond egm; ERROR text:="handled"; RETURN;')
    assert "No datagram has come for 0.5 s" in bench.failure
    assert bench.read("text") == '""'


@pytest.mark.parametrize(
    "instruction",
    ["EGMActPose egm,identity,EGM_FRAME_BASE,identity,EGM_FRAME_BASE\\x:=[-1,1]", "EGMRunPose egm,EGM_STOP_HOLD\\x"],
)
def test_poses_are_not_for_a_seven_axis_arm(bench: InstructionBench, instruction: str) -> None:
    bench.start(SETUP + instruction + ";", others="; CONST pose identity:=[[0,0,0],[1,0,0,0]]")
    bench.finish()
    assert "EGM moves a seven-axis arm by EGMActJoint and EGMRunJoint" in bench.failure
    assert [event.code for event in bench.events.entries()] == [41826]


def test_stop_ends_a_run(bench: InstructionBench) -> None:
    start = RUN.replace("HOLD", "HOLD\\NoWaitCond")
    bench.start(MOVE + SETUP + ACT + start + "WaitTime 0.1; EGMStop egm,EGM_STOP_HOLD; number:=EGMGetState(egm);")
    guide(bench)
    assert float(bench.read("number")) == EgmClientState.CONNECTED
    assert bench.unit.arm.is_stationary


def test_reset_gives_the_identity_back(bench: InstructionBench) -> None:
    bench.run("EGMGetId egm; EGMReset egm; number:=EGMGetState(egm);")
    assert float(bench.read("number")) == EgmClientState.DISCONNECTED
    assert bench.unit.egm_identities == set()


def test_egm_cannot_be_the_first_motion(bench: InstructionBench) -> None:
    bench.run(SETUP + ACT + RUN)
    assert "EGM cannot be the first motion after a start" in bench.failure


def test_run_needs_an_identity(bench: InstructionBench) -> None:
    bench.run(MOVE + RUN)
    assert "EGM of the right arm is disconnected" in bench.failure


def test_fifth_identity_is_refused(bench: InstructionBench) -> None:
    names = ("b", "c", "d", "e")
    declarations = "; ".join(f"VAR egmident {name}" for name in names)
    bench.start("EGMGetId egm; " + "".join(f"EGMGetId {name};" for name in names), others=f"; {declarations}")
    bench.finish()
    assert "4 EGM identities are in use" in bench.failure
    assert bench.events.entries()[0].code == 41828


def test_same_variable_keeps_its_identity(bench: InstructionBench) -> None:
    bench.run("FOR i FROM 1 TO 9 DO EGMGetId egm; ENDFOR")
    assert bench.failure == ""


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ('"ROB_R","NOWHERE"\\Joint', "no Transmission Protocol of type UDPUC is called 'NOWHERE'"),
        ('"NOTHING","ROB_R"\\Joint', "there is no External Motion Interface Data 'NOTHING'"),
        ('"ROB_R","ROB_R"\\Pose', "a seven-axis arm uses EGM with \\Joint"),
    ],
)
def test_setup_names_what_is_missing(bench: InstructionBench, arguments: str, sentence: str) -> None:
    bench.run(f"EGMGetId egm; EGMSetupUC ROB_ID,egm,{arguments};")
    assert sentence in bench.failure


def test_setup_refuses_a_unit_that_is_no_robot(bench: InstructionBench) -> None:
    bench.run('EGMGetId egm; EGMSetupUC ROB_R_7,egm,"ROB_R","ROB_R"\\Joint;')
    assert "ROB_R_7 is not a TCP robot" in bench.failure


def test_device_name_may_end_in_a_colon(bench: InstructionBench) -> None:
    bench.run('EGMGetId egm; EGMSetupUC ROB_ID,egm,"ROB_R","UCdevice:"\\Joint;')
    assert bench.failure == ""
    assert bench.unit.egm_device == "UCdevice"


@pytest.mark.parametrize(
    ("do_not_restart", "state"), [("FALSE", EgmClientState.RUNNING), ("TRUE", EgmClientState.CONNECTED)]
)
def test_interrupted_run_goes_on_after_motors_off_unless_configured_otherwise(
    bench: InstructionBench, do_not_restart: str, state: EgmClientState
) -> None:
    attributes = {"do_not_restart_after_motors_off": do_not_restart}
    bench.configuration.change("MOC", "EXT_MOTION_DATA", "ROB_R", attributes)
    bench.start(MOVE + SETUP + ACT + RUN.replace("0.2", "9") + "WaitTime 9;")
    guide(bench, limit=0.3)
    bench.task.stop()
    bench.unit.arm.switch_motors_off()
    bench.step()
    bench.unit.arm.switch_motors_on()
    bench.task.start()
    guide(bench, limit=0.6)
    assert bench.unit.egm.state is state
    assert bench.task.is_running


def test_activation_begins_a_stream_when_told_so(bench: InstructionBench) -> None:
    bench.run(SETUP + "EGMActJoint egm\\StreamStart\\SampleRate:=8; WaitTime 0.2; EGMStreamStop egm; WaitTime 0.1;")
    assert 20 <= len(bench.sent) <= 30
    assert SensorCodec().decode(bench.sent[0]).seqno == 0


def test_stream_sends_until_it_is_stopped(bench: InstructionBench) -> None:
    bench.run(SETUP + "EGMStreamStart egm\\SampleRate:=8; WaitTime 0.2; EGMStreamStop egm; WaitTime 0.2;")
    assert 20 <= len(bench.sent) <= 30


def test_activation_is_accepted_while_positions_are_streamed_and_the_run_ends_the_stream(
    bench: InstructionBench,
) -> None:
    bench.start(MOVE + SETUP + "EGMStreamStart egm; WaitTime 0.1; " + ACT + "WaitTime 0.1; " + RUN)
    guide(bench)
    assert bench.failure == ""
    messages = [SensorCodec().decode(datagram) for datagram in bench.sent]
    begins = [index for index, message in enumerate(messages) if message.seqno == 0]
    assert [messages[index].mci for index in begins] == [MciState.STOPPED, MciState.RUNNING]
    assert begins[1] > 45, "the stream goes on behind the activation"
    shifts = [hypot(*(np.subtract(m.measured_pose.position, messages[0].measured_pose.position))) for m in messages]  # type: ignore[union-attr]
    assert shifts[begins[1] - 1] == pytest.approx(0.1), "with the tool of the activation"
    assert messages[-1].mci is MciState.STOPPED


def test_activation_with_a_stream_lets_the_one_that_runs_go_on(bench: InstructionBench) -> None:
    act = ACT.replace("egm", "egm\\StreamStart", 1)
    bench.run(MOVE + SETUP + "EGMStreamStart egm; WaitTime 0.1; " + act + "WaitTime 0.1; number:=EGMGetState(egm);")
    assert bench.failure == ""
    assert float(bench.read("number")) == EgmClientState.RUNNING
    assert SensorCodec().decode(bench.sent[-1]).seqno == len(bench.sent) - 1


def test_activation_is_refused_while_egm_moves_the_arm(bench: InstructionBench) -> None:
    bench.run(MOVE + SETUP + ACT + RUN.replace("HOLD", "HOLD\\NoWaitCond") + ACT)
    assert "EGM of the right arm is running: it has to be connected" in bench.failure


def test_run_after_a_timeout_waits_until_the_arm_stands(bench: InstructionBench) -> None:
    bench.start(MOVE + SETUP + ACT + RUN + "flag:=TRUE; " + RUN + 'text:="done"; ERROR TRYNEXT;')
    codec, arm = SensorCodec(), bench.unit.arm
    aside = tuple(value + 0.5 for value in arm.planned)
    while bench.read("flag") == "FALSE":  # references for a while, then none until the program goes on
        bench.inbox = [codec.encode(SensorMessage(0, aside))] if bench.sent and bench.task.now < 0.4 else []
        bench.step()
    assert not arm.is_stationary
    assert bench.task.is_running, bench.failure
    guide(bench)
    assert (bench.failure, bench.read("text")) == ("", '"done"')


def test_run_needs_a_fine_point_before_it(bench: InstructionBench) -> None:
    move = "MoveAbsJ [[0,-130,30,0,50,0],[-135,9E9,9E9,9E9,9E9,9E9]],v100,z50,tool0; "
    bench.run(SETUP + ACT + move + RUN)
    assert "EGM has to begin in a fine point: end the move before it with zonedata fine" in bench.failure


def test_tool_shifts_the_pose_in_the_datagrams(bench: InstructionBench) -> None:
    bench.run(
        SETUP + "EGMStreamStart egm; WaitTime 0.1; EGMStreamStop egm; " + ACT + "EGMStreamStart egm; WaitTime 0.1;"
    )
    first, last = (SensorCodec().decode(bench.sent[index]).measured_pose for index in (0, -1))
    assert first is not None
    assert last is not None
    assert sum((a - b) ** 2 for a, b in zip(first.position, last.position, strict=True)) ** 0.5 == pytest.approx(0.1)


def test_raw_data_shortens_the_reaction(bench: InstructionBench) -> None:
    raw = SETUP.replace('"ROB_R","ROB_R"', '"ROB_R_RAW","ROB_R"')
    bench.start(MOVE + raw + ACT + RUN)
    guide(bench)
    filtered = InstructionBench()
    filtered.start(MOVE + SETUP + ACT + RUN)
    guide(filtered)
    assert bench.unit.arm.reaction_time < filtered.unit.arm.reaction_time


def test_convergence_bands_arrive_in_chain_order(bench: InstructionBench, monkeypatch: pytest.MonkeyPatch) -> None:
    activations: list[EgmActivation] = []
    monkeypatch.setattr(bench.unit.egm, "activate", activations.append)
    bands = "".join(f"\\J{axis}:=[-{axis},{axis}]" for axis in range(1, 8))
    bench.run(f"{SETUP} EGMActJoint egm{bands};")
    highest = [high for _, high in activations[0].cond_min_max]
    assert highest == pytest.approx([radians(axis) for axis in (1, 2, 7, 3, 4, 5, 6)])


def signal(name: str, kind: SignalType) -> ControllerSignal:
    return ControllerSignal(name, kind, "", "All", 0.0, "")


SIGNALS = (signal("ao_axis_1", SignalType.ANALOG_OUTPUT), signal("ao_axis_7", SignalType.ANALOG_OUTPUT))
FROM_SIGNALS = (
    'EGMGetId egm; EGMSetupAO ROB_ID,egm,"ROB_R"\\Joint\\aoR1x:=ao_axis_1\\aoE1:=ao_axis_7; '
    "EGMActJoint egm\\J1:=[-0.1,0.1]\\J7:=[-0.1,0.1]\\MaxSpeedDeviation:=100; target:=CJointT(); "
    "SetAO ao_axis_1,target.robax.rax_1+2; SetAO ao_axis_7,target.extax.eax_a-1; "
    "EGMRunJoint egm,EGM_STOP_HOLD\\J1\\J2\\J7\\CondTime:=0.2; "
)


def test_analog_signals_guide_the_axes_without_any_datagram() -> None:
    bench = InstructionBench(signals=SIGNALS)
    before = jointtarget(bench.unit.arm.planned)
    bench.run(MOVE + FROM_SIGNALS + "flag:=TRUE;")
    assert (bench.failure, bench.read("flag"), bench.sent) == ("", "TRUE", [])
    robax, extax = jointtarget(bench.unit.arm.planned)
    assert robax[0] == pytest.approx(before[0][0] + 2, abs=0.15)
    assert extax[0] == pytest.approx(before[1][0] - 1, abs=0.15)
    assert robax[1:] == pytest.approx(before[0][1:], abs=1e-6)


def test_signals_that_lead_out_of_an_axis_range_stop_egm() -> None:
    bench = InstructionBench(signals=SIGNALS)
    bench.start(MOVE + FROM_SIGNALS.replace("rax_1+2", "rax_1+400"))
    while bench.unit.egm.outcome is not EgmOutcome.OUT_OF_BOUNDS and bench.task.now < 5.0:
        bench.step()
    assert bench.unit.egm.outcome is EgmOutcome.OUT_OF_BOUNDS
    assert not bench.unit.arm.motors_on


@pytest.mark.parametrize(
    ("setup", "sentence"),
    [
        ('EGMSetupAI ROB_ID,egm,"ROB_R"\\Joint', "at least one signal has to be given"),
        ('EGMSetupGI ROB_ID,egm,"ROB_R"\\Pose\\giR1x:=gi_one', "signals guide the joints here: use \\Joint"),
        ('EGMSetupAI ROB_R_7,egm,"ROB_R"\\Joint\\aiR1x:=ai_one', "ROB_R_7 is not a TCP robot"),
        ('EGMSetupGI ROB_ID,egm,"none"\\Joint\\giR1x:=gi_one', "there is no External Motion Interface Data 'none'"),
    ],
)
def test_setup_from_signals_says_what_is_wrong(setup: str, sentence: str) -> None:
    bench = InstructionBench(
        signals=(signal("ai_one", SignalType.ANALOG_INPUT), signal("gi_one", SignalType.GROUP_INPUT))
    )
    bench.run(f"EGMGetId egm; {setup};")
    assert sentence in bench.failure
