"""Moves that do something on the way: outputs, interrupts, procedures, searches, stops."""

import numpy as np
import pytest
from drawn_path import Array, Drawing, at, from_line
from instruction_bench import InstructionBench

from abb_protocols.rws.values import SignalType
from virtual_irc5.controller.signals import ControllerSignal
from virtual_irc5.rapid.states import EventKind

TO_START = r"ConfL\Off; ConfJ\Off; MoveAbsJ [[20,-100,20,0,60,0],[-110,9E9,9E9,9E9,9E9,9E9]],vmax,fine,tool0; "
BEGIN = r"ConfL\Off; point:=CRobT(\Tool:=tool0\WObj:=wobj0); "
TRIGGER_DO = r"TriggIO event,5\DOp:=done,{}; TriggL Offs(point,0,0,-50),v200,event,fine,tool0;"
TURN = "{} Offs(point,0,0,-100),v200,z20,tool0{}; MoveL Offs(point,100,0,-100),v200,fine,tool0;"


def signal(name: str, kind: SignalType) -> ControllerSignal:
    return ControllerSignal(name, kind, "", "All", 0.0, "")


@pytest.fixture
def bench() -> InstructionBench:
    kinds = {
        "done": SignalType.DIGITAL_OUTPUT,
        "group": SignalType.GROUP_OUTPUT,
        "glue": SignalType.ANALOG_OUTPUT,
        "touch": SignalType.DIGITAL_INPUT,
    }
    bench = InstructionBench(signals=[signal(name, kind) for name, kind in kinds.items()])
    bench.run(TO_START)
    return bench


class Watched(Drawing):
    """A drawing that notes where the tool was when a signal changed [mm]."""

    def __init__(self, body: str, bench: InstructionBench, name: str) -> None:
        self.places: list[Array] = []
        self._bench, self._step, self._name = bench, bench.step, name
        self._value = bench.signals.get(name).value
        bench.step = self._watch  # type: ignore[method-assign]
        super().__init__(BEGIN + body, bench=bench)

    def _watch(self) -> None:
        self._step()
        now = self._bench.signals.get(self._name).value
        if now != self._value:
            self._value = now
            arm = self._bench.unit.arm
            self.places.append(np.array(arm.kinematics.tool0(arm.position).position) * 1e3)


@pytest.mark.parametrize(
    ("kind", "arguments", "name", "value"),
    [
        ("MoveLDO", ",done,1", "done", 1),
        ("MoveLAO", ",glue,2.5", "glue", 2.5),
        ("MoveLGO", r",group\Value:=5", "group", 5),
        ("MoveJAO", ",glue,2.5", "glue", 2.5),
        ("MoveJGO", r",group\Value:=5", "group", 5),
    ],
)
def test_move_with_output_sets_it_in_the_middle_of_the_corner(
    bench: InstructionBench, kind: str, arguments: str, name: str, value: float
) -> None:
    drawing = Watched(TURN.format(kind, arguments), bench, name)
    turn = drawing.points[0] + at(0, 0, -100)
    nearest = np.min(np.linalg.norm(drawing.points - turn, axis=1))
    assert np.linalg.norm(drawing.places[0] - turn) < nearest + 1.0
    assert bench.signals.get(name).value == value


def test_move_with_procedure_calls_it_in_the_corner_while_the_arm_moves(bench: InstructionBench) -> None:
    bench.start(BEGIN + TURN.format("MoveLSync", r',"count"'))
    while bench.read("number") == "0":
        bench.step()
    assert not bench.unit.arm.is_stationary
    bench.finish()
    assert bench.read("number") == "1"


@pytest.mark.parametrize(("where", "z_mm"), [("30", -70.0), (r"30\Start", -30.0), ("0", -100.0)])
def test_trigger_sets_an_output_at_its_distance(bench: InstructionBench, where: str, z_mm: float) -> None:
    body = rf"TriggIO event,{where}\DOp:=done,1; TriggL Offs(point,0,0,-100),v100,event,fine,tool0;"
    drawing = Watched(body, bench, "done")
    assert drawing.places[0] == pytest.approx(drawing.points[0] + at(0, 0, z_mm), abs=1.0)


def test_trap_of_a_trigger_reads_the_position_of_the_trigger(bench: InstructionBench) -> None:
    bench.run(
        BEGIN + "CONNECT interrupt WITH note; TriggInt event,50,interrupt; "
        "TriggL Offs(point,0,0,-100),v100,event,fine,tool0;"
    )
    begin, read = (float(bench.read(name).split(",")[2].rstrip("]")) for name in ("point", "tip"))
    assert read - begin == pytest.approx(-50.0, abs=0.6), "a cycle is 0.4 mm"


@pytest.mark.parametrize("move", ["MoveLDO", "MoveJDO"])
def test_output_at_a_fine_point_is_set_when_the_move_is_over(bench: InstructionBench, move: str) -> None:
    bench.run(BEGIN + f"{move} Offs(point,0,0,-100),v100,fine,tool0,done,1; number:=DOutput(done);")
    assert (bench.failure, bench.read("number")) == ("", "1")


def test_trigger_by_time_comes_that_long_before_the_end(bench: InstructionBench) -> None:
    body = r"TriggIO event,0.2\Time\DOp:=done,1; TriggL Offs(point,0,0,-100),v100,event,z50,tool0; "
    drawing = Watched(body + "MoveL Offs(point,0,0,-200),v100,fine,tool0;", bench, "done")
    assert drawing.places[0] == pytest.approx(drawing.points[0] + at(0, 0, -80), abs=1.5)


def test_equipment_that_needs_time_is_switched_earlier(bench: InstructionBench) -> None:
    body = r"TriggEquip event,20,0.1\DOp:=done,1; TriggL Offs(point,0,0,-100),v100,event,fine,tool0;"
    drawing = Watched(body, bench, "done")
    assert drawing.places[0] == pytest.approx(drawing.points[0] + at(0, 0, -70), abs=1.5)


def test_trigger_interrupts_at_its_distance(bench: InstructionBench) -> None:
    bench.run(
        BEGIN + "CONNECT interrupt WITH note; TriggInt event,50,interrupt; "
        "TriggL Offs(point,0,0,-100),v100,event,fine,tool0;"
    )
    assert bench.read("number") == "1"
    start, tip = (bench.task.read("Program", name).split("],")[0].strip("[").split(",") for name in ("point", "tip"))
    assert float(start[2]) - float(tip[2]) == pytest.approx(50.0, abs=4.0)  # measured a servo's delay later


def test_several_triggers_of_an_array_act_in_their_order(bench: InstructionBench) -> None:
    body = (
        r"TriggIO events{1},80\DOp:=done,1; TriggIO events{2},50\DOp:=done,0; TriggIO events{3},20\DOp:=done,1; "
        "TriggL Offs(point,0,0,-100),v100,events,fine,tool0;"
    )
    drawing = Watched(body, bench, "done")
    heights = [drawing.places[index][2] - drawing.points[0][2] for index in range(3)]
    assert heights == pytest.approx([-20.0, -50.0, -80.0], abs=1.0)


def test_trigger_on_joint_move_and_circle(bench: InstructionBench) -> None:
    body = (
        r"TriggIO event,10\DOp:=done,1; TriggJ Offs(point,0,0,-60),v100,event,fine,tool0; "
        r"TriggIO another,10\DOp:=done,0; "
        "TriggC Offs(point,30,0,-90),Offs(point,0,0,-120),v100,another,fine,tool0;"
    )
    drawing = Watched(body, bench, "done")
    assert len(drawing.places) == 2
    assert np.linalg.norm(drawing.places[0] - drawing.points[0] - at(0, 0, -60)) == pytest.approx(10.0, abs=1.0)
    assert np.linalg.norm(drawing.places[1] - drawing.points[0] - at(0, 0, -120)) == pytest.approx(9.94, abs=1.0)


def test_check_of_an_input_interrupts_where_it_is_not_as_expected(bench: InstructionBench) -> None:
    check = "CONNECT interrupt WITH note; TriggCheckIO event,50,touch,EQ,{},interrupt; "
    move = "TriggL Offs(point,0,0,-100),v100,event,fine,tool0;"
    bench.run(BEGIN + check.format(1) + move)
    assert bench.read("number") == "1"


def test_analog_output_follows_a_ramp(bench: InstructionBench) -> None:
    body = "TriggRampAO event,80,0,glue,10,40; TriggL Offs(point,0,0,-100),v100,event,fine,tool0;"
    drawing = Watched(body, bench, "glue")
    first, last = drawing.points[0] - drawing.places[0], drawing.points[0] - drawing.places[-1]
    assert (first[2], last[2]) == pytest.approx((22.0, 60.0), abs=2.0)
    assert bench.signals.get("glue").value == pytest.approx(10.0)


def test_trigger_data_are_empty_until_they_are_defined(bench: InstructionBench) -> None:
    bench.run(r"flag:=TriggDataValid(event); TriggIO event,5\DOp:=done,1; TriggDataCopy event,another;")
    assert bench.read("flag") == "FALSE"
    bench.run(r"TriggIO event,5\DOp:=done,1; TriggDataCopy event,another; flag:=TriggDataValid(another);")
    assert bench.read("flag") == "TRUE"
    bench.run(BEGIN + "TriggL Offs(point,0,0,-10),v100,event,fine,tool0;")
    assert "a triggdata has to be defined" in bench.failure


@pytest.mark.parametrize(("stop", "end_mm"), [("", -100.0), (r"\Stop,", None), (r"\PStop,", None)])
def test_search_keeps_the_place_where_the_signal_came(bench: InstructionBench, stop: str, end_mm: float | None) -> None:
    bench.start(BEGIN + f"SearchL{stop} touch,found,Offs(point,0,0,-100),v50,tool0;")
    start = bench.unit.arm.kinematics.tool0(bench.unit.arm.planned).position[2] * 1e3
    for _ in range(250):
        bench.step()
    bench.signals.drive("touch", 1.0)
    here = bench.unit.arm.kinematics.tool0(bench.unit.arm.position).position[2] * 1e3
    bench.finish()
    found = float(bench.read("found").split(",")[2].strip("]"))
    assert found == pytest.approx(here, abs=0.3)
    end = bench.unit.arm.kinematics.tool0(bench.unit.arm.planned).position[2] * 1e3
    if end_mm is None:
        assert here - 12.0 < end < here
    else:
        assert end - start == pytest.approx(end_mm, abs=0.02)


def test_search_that_finds_nothing_is_an_error_a_handler_takes(bench: InstructionBench) -> None:
    bench.run(BEGIN + "SearchL touch,found,Offs(point,0,0,-20),v100,tool0;")
    assert "ERR_WHLSEARCH" in bench.failure
    bench.signals.drive("touch", 1.0)
    bench.run(BEGIN + "SearchL touch,found,Offs(point,0,0,-20),v100,tool0;")
    assert "ERR_SIGSUPSEARCH" in bench.failure


def test_trap_steps_aside_and_the_path_goes_on(bench: InstructionBench) -> None:
    bench.start(
        BEGIN + "CONNECT interrupt WITH step_aside; ISignalDI touch,1,interrupt; "
        "MoveL Offs(point,0,0,-100),v100,fine,tool0; flag:=TRUE;"
    )
    start = np.array(bench.unit.arm.kinematics.tool0(bench.unit.arm.planned).position) * 1e3
    points = []
    while bench.task.is_running and bench.task.now < 60.0:
        bench.step()
        points.append(np.array(bench.unit.arm.kinematics.tool0(bench.unit.arm.planned).position) * 1e3)
        if len(points) == 100:
            bench.signals.drive("touch", 1.0)
    offset = np.array(points) - start
    assert bench.read("number") == "1"
    assert bench.read("flag") == "TRUE"
    assert np.max(offset[:, 1]) == pytest.approx(30.0, abs=0.05)
    assert offset[-1] == pytest.approx((0, 0, -100), abs=0.02)
    on_line = offset[np.abs(offset[:, 1]) < 0.02]
    assert np.max(np.hypot(on_line[:, 0], on_line[:, 1])) < 0.1


def test_stopped_path_waits_for_start_move_and_stays_straight(bench: InstructionBench) -> None:
    drawing = Drawing(
        BEGIN + r"MoveL\Conc, Offs(point,0,0,-100),v100,fine,tool0; WaitTime 0.4; StopMove; flag:=IsStopMoveAct(); "
        r"WaitTime 0.5; StartMove; WaitRob\InPos;",
        bench=bench,
    )
    assert bench.read("flag") == "TRUE"
    assert drawing.points[-1] == pytest.approx(drawing.points[0] + at(0, 0, -100), abs=1e-2)
    assert np.max(from_line(drawing.points, drawing.points[0], drawing.points[0] + at(0, 0, -100))) < 0.1
    assert np.min(drawing.speeds[50:-50]) < 5.0


def test_cleared_path_is_not_gone_on_with(bench: InstructionBench) -> None:
    drawing = Drawing(
        BEGIN + r"MoveL\Conc, Offs(point,0,0,-100),v100,fine,tool0; WaitTime 0.4; StopMove; ClearPath; StartMove; "
        "WaitTime 0.5; MoveL point,v100,fine,tool0;",
        bench=bench,
    )
    lowest = np.min(drawing.points[:, 2]) - drawing.points[0][2]
    assert -60.0 < lowest < -20.0
    assert drawing.points[-1] == pytest.approx(drawing.points[0], abs=1e-2)


@pytest.mark.parametrize(
    "body",
    ["MoveLDO Offs(point,0,0,-50),v200,fine,tool0,done,5;", TRIGGER_DO.format(5)],
)
def test_digital_output_on_the_path_is_set_by_any_number_but_zero(bench: InstructionBench, body: str) -> None:
    bench.run(BEGIN + body)
    assert (bench.failure, bench.signals.get("done").value) == ("", 1.0)


@pytest.mark.parametrize(("error", "name"), [(KeyError("done"), "ERR_SIG_NOT_VALID"), (TypeError("a slip"), "")])
def test_error_at_a_place_on_the_path_stops_the_program_not_the_controller(
    bench: InstructionBench, monkeypatch: pytest.MonkeyPatch, error: Exception, name: str
) -> None:
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr(bench.host, "write_signal", fail)
    bench.run(BEGIN + "MoveLDO Offs(point,0,0,-50),v200,fine,tool0,done,1; number:=3;")
    stop = bench.host.events[-1]
    assert (stop.kind, stop.error, bench.read("number")) == (EventKind.ERROR, name, "0")
    assert stop.sentence.startswith("T_ROB_R stopped in Program/main, line ")
    bench.run("number:=7;")
    assert bench.read("number") == "7"


@pytest.mark.parametrize(
    ("move", "name", "value"), [("MoveCAO {},glue,2.5;", "glue", 2.5), (r"MoveCGO {},group\Value:=5;", "group", 5)]
)
def test_circle_with_output_sets_it_at_its_end(bench: InstructionBench, move: str, name: str, value: float) -> None:
    arc = "Offs(point,40,0,-40),Offs(point,0,0,-80),v200,fine,tool0"
    drawing = Watched(move.format(arc), bench, name)
    assert drawing.places[0] == pytest.approx(drawing.points[0] + at(0, 0, -80), abs=1.0)
    assert bench.signals.get(name).value == value


def test_output_follows_the_speed_of_the_tool_from_the_trigger_on(bench: InstructionBench) -> None:
    bench.start(BEGIN + r"TriggSpeed event,40\Start,0,glue,10; TriggL Offs(point,0,0,-100),v100,event,fine,tool0;")
    most = 0.0
    while bench.task.is_running:
        bench.step()
        most = max(most, bench.signals.get("glue").value)
    assert most == pytest.approx(0.1 * 10, rel=0.02)  # m/s times the factor
    for _ in range(10):
        bench.step()
    assert bench.signals.get("glue").value == pytest.approx(0.0, abs=1e-6)


def test_external_axis_searches_for_a_signal(bench: InstructionBench) -> None:
    bench.start(
        r"target:=CJointT(); start:=target; target.extax.eax_a:=target.extax.eax_a+20; "
        r"SearchExtJ\Stop,touch,start,target,vrot20;"
    )
    for _ in range(100):
        bench.step()
    bench.signals.drive("touch", 1.0)
    bench.finish()
    assert bench.failure == ""
    found = float(bench.read("start").split("],[")[1].split(",")[0])
    assert -105.0 < found < -91.0
    assert np.degrees(bench.unit.arm.planned[2]) == pytest.approx(found, abs=1.5)
