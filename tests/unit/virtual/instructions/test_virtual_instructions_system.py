"""System instructions: units, configuration, meeting other tasks."""

import pytest
from instruction_bench import InstructionBench

from abb_protocols.robot.joints import Side
from virtual_irc5.instructions.multimove import SyncPoints

MEET = "WaitSyncTask\\InPos,meeting,both\\TimeOut:=1; flag:=TRUE;"


@pytest.fixture
def bench() -> InstructionBench:
    return InstructionBench(Side.LEFT)


def test_robot_id_is_the_arm_of_the_task(bench: InstructionBench) -> None:
    bench.run("text:=GetMecUnitName(ROB_ID); flag:=IsMechUnitActive(ROB_ID);")
    assert (bench.read("text"), bench.read("flag")) == ('"ROB_L"', "TRUE")


def test_units_are_listed_one_after_the_other(bench: InstructionBench) -> None:
    bench.run("WHILE GetNextMechUnit(number,text) DO TPWrite text; ENDWHILE")
    assert list(bench.host.lines) == ["ROB_R", "ROB_L", "ROB_R_7", "ROB_L_7"]


def test_modal_payload_mode_is_that_of_a_yumi(bench: InstructionBench) -> None:
    bench.run("number:=GetModalPayLoadMode();")
    assert bench.read("number") == "1"


def test_configuration_is_read_as_text_and_as_number(bench: InstructionBench) -> None:
    bench.run(
        'ReadCfgData "/MOC/ROBOT/ROB_L","use_joint_1",text; ReadCfgData "/MOC/ARM/rob_L_2","cal_position",number;'
        ' ReadCfgData "/MOC/TRANSMISSION/rob_L_2","rotating_move",flag;'
    )
    assert (bench.read("text"), bench.read("number"), bench.read("flag")) == ('"rob_L_2"', "-2.26893", "TRUE")


@pytest.mark.parametrize(
    ("path", "attribute", "error"),
    [
        ("/MOC/ROBOT/ROB_X", "use_joint_0", "ERR_CFG_NOTFND"),
        ("/MOC/ROBOT/ROB_L", "nothing", "ERR_CFG_NOTFND"),
        ("/MOC", "nothing", "ERR_CFG_NOTFND"),
        ("/MOC/ROBOT/ROB_L", "use_joint_0", "ERR_CFG_ILLTYPE"),
    ],
)
def test_configuration_that_is_not_there_raises(bench: InstructionBench, path: str, attribute: str, error: str) -> None:
    bench.run(f'ReadCfgData "{path}","{attribute}",number;')
    assert error in bench.failure


def test_tasks_meet_at_a_point() -> None:
    points = SyncPoints()
    right, left = (InstructionBench(side, sync_points=points) for side in (Side.RIGHT, Side.LEFT))
    right.start(MEET)
    for _ in range(50):
        right.step()
    assert right.task.is_running
    left.run(MEET)
    right.step()
    assert (right.read("flag"), left.read("flag")) == ("TRUE", "TRUE")


def test_task_that_waits_in_vain_gets_an_error(bench: InstructionBench) -> None:
    assert bench.run(MEET) == pytest.approx(1.0, abs=0.02)
    assert "ERR_WAITSYNCTASK" in bench.failure


def test_task_that_gave_up_does_not_count_as_arrived() -> None:
    points = SyncPoints()
    InstructionBench(Side.RIGHT, sync_points=points).run(MEET)
    left = InstructionBench(Side.LEFT, sync_points=points)
    left.run(MEET)
    assert "ERR_WAITSYNCTASK" in left.failure
