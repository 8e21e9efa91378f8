"""The public client abb-motion-program-exec, unchanged, against the virtual controller: every method of its client.

The robot's side of its protocol is RAPID of our own (``motion_programs``): an interpreter of the files it uploads, in
the task of each arm, and a recorder. The tasks are called T_ROB1 and T_ROB2, since the client tells two robots apart by
the number at the end.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from rws_bench import PASSWORD, USER

from abb_protocols.robot.joints import Side
from virtual_irc5.controller.installed_system import System
from virtual_irc5.http_server import HttpServer
from virtual_irc5.rws.rws_service import RwsService
from virtual_irc5.world import World, WorldSettings

mpx = pytest.importorskip(
    "abb_motion_program_exec.abb_motion_program_exec_client", reason="needs abb-motion-program-exec"
)

FOLDER = Path(__file__).parent / "motion_programs"
RIGHT, LEFT = -135.0, 135.0  # axis 7 at home [deg]
FRAME = mpx.pose([0, 0, 0], [1, 0, 0, 0])


class Site:
    """A YuMi with the interpreter, its RWS server, and the client; time passes while it is not held."""

    def __init__(self) -> None:
        files = {f"HOME:/{path.name}": path.read_bytes() for path in FOLDER.glob("*.mod")}
        cfg = {path.stem: path.read_text(encoding="ascii") for path in FOLDER.glob("*.cfg")}
        system = System((cfg["EIO"], cfg["MOC"]), files, restored=(cfg["SYS"],), is_factory=True)
        self.world = World(WorldSettings(system=system))
        self.controller = self.world.controller
        self.lock, self.over, self.flows = threading.Lock(), threading.Event(), threading.Event()
        self.flows.set()
        self.service = RwsService(self.controller, user=USER, password=PASSWORD)
        self.thread = threading.Thread(target=self.live)

    def handle(self, request: Any) -> Any:
        with self.lock:
            return self.service.handle(request, time.monotonic())

    def cycle(self) -> None:
        with self.lock:
            self.world.cycle({})
            self.service.advance(time.monotonic())

    def live(self) -> None:
        while not self.over.wait(0.002):
            for _ in range(3 if self.flows.is_set() else 0):
                self.cycle()

    def pass_until(self, condition: Callable[[], bool]) -> None:
        """Let time pass while it is held otherwise."""
        for _ in range(10_000):
            if condition():
                return
            self.cycle()
        raise AssertionError("not in 40 s of the robot's time")

    def signal(self, name: str) -> float:
        with self.lock:
            return self.controller.signals.get(name).value

    def joints(self, unit: str) -> tuple[float, ...]:
        """Axes 1 to 6 [deg]."""
        with self.lock:
            return tuple(self.controller.joint_target(unit)[0])


@pytest.fixture(scope="module")
def whole_site() -> Iterator[Site]:
    site = Site()
    with HttpServer(site.handle, 0) as server:
        site.thread.start()
        site.client = mpx.MotionProgramExecClient(f"http://{server.address}", USER, PASSWORD)  # type: ignore[attr-defined]
        site.client.abb_client.set_controller_state("motoron")  # type: ignore[attr-defined]
        yield site
        site.over.set()
        site.thread.join()


@pytest.fixture
def site(whole_site: Site) -> Iterator[Any]:
    """Both arms at home, time passing, RAPID stopped."""
    client: Any = whole_site.client  # type: ignore[attr-defined]
    home = mpx.MotionProgram(), mpx.MotionProgram()
    for program, angle in zip(home, (RIGHT, LEFT), strict=True):
        program.MoveAbsJ(joints(0, angle), mpx.v5000, mpx.fine)
    client.execute_multimove_motion_program(list(home))
    yield whole_site
    whole_site.flows.set()
    if client.is_motion_program_running():
        client.stop_motion_program()


def joints(axis_6: float, axis_7: float = RIGHT) -> Any:
    return mpx.jointtarget([0, -130, 30, 0, 40, axis_6], [axis_7, *[9e9] * 5])


def target(client: Any, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Any:
    """A place beside where the right tool is now [mm]."""
    now = client.abb_client.get_robtarget("ROB_R")
    place = [now.trans[0] + x, now.trans[1] + y, now.trans[2] + z]
    return mpx.robtarget(place, list(now.rot), mpx.confdata(*now.robconf), list(now.extax))


def test_every_command_of_a_program_moves_the_arm(site: Any) -> None:
    client = site.client
    begin, line, middle, end = (target(client, *at) for at in ((), (20, 0, 0), (25, 5, 0), (20, 10, 0)))
    program = mpx.MotionProgram(timestamp="2026-07-09-08-15-30-0001", seqno=3)
    program.MoveAbsJ(joints(5), mpx.v1000, mpx.fine)
    program.MoveJ(begin, mpx.v1000, mpx.fine)
    program.MoveL(line, mpx.v100, mpx.z1)
    for mode in mpx.CirPathModeSwitch:
        program.CirPathMode(mode)
    program.CirPathMode(mpx.CirPathModeSwitch.PathFrame)
    program.MoveC(middle, end, mpx.v100, mpx.fine)
    program.WaitTime(0.2)
    result = client.execute_motion_program(program)
    assert program.get_timestamp() == result.timestamp == "2026-07-09-08-15-30-0001"
    assert result.column_headers[:3] == ["timestamp", "cmdnum", "J1"]
    assert result.data.shape[1] == len(result.column_headers) == 14
    assert {1.0, 2.0, 3.0, 11.0, 12.0} == set(result.data[:, 1]) - {0.0}
    assert max(result.data[:, 7]) == pytest.approx(5, abs=0.2)
    assert result.data[-1, 2:8] == pytest.approx(site.joints("ROB_R"), abs=1e-3)
    assert client.abb_client.get_robtarget("ROB_R").trans == pytest.approx(end.trans, abs=0.05)
    with site.lock:
        assert not [name for name in site.controller.files if name.startswith("RAMDISK:/log-")]  # read and deleted


def test_a_program_longer_than_a_buffer_uses_its_tool_and_work_object(site: Any) -> None:
    client = site.client
    load = mpx.loaddata(0.1, [0, 0, 20], [1, 0, 0, 0], 0, 0, 0)
    tool = mpx.tooldata(True, mpx.pose([0, 0, 100], [1, 0, 0, 0]), load)
    wobj = mpx.wobjdata(False, True, "", mpx.pose([10, 0, 0], [1, 0, 0, 0]), FRAME)
    program = mpx.MotionProgram(tool=tool, wobj=wobj, gripload=load)
    for angle in range(1, 31):
        program.MoveAbsJ(joints(angle / 10), mpx.v1000, mpx.z1)
    assert len(program.get_program_bytes()) > 2 * 1024
    client.execute_motion_program(program)
    assert site.joints("ROB_R")[5] == pytest.approx(3, abs=1e-3)
    with site.lock:
        task = site.controller.tasks["T_ROB1"]
        assert task.read("Interpreter", "usedFrame").startswith('[FALSE,TRUE,"",[[10,0,0],')
        assert task.read("Interpreter", "usedTool").startswith("[TRUE,[[0,0,100],")


def test_both_arms_move_together(site: Any) -> None:
    programs = mpx.MotionProgram(), mpx.MotionProgram()
    for program, axis_6, axis_7 in zip(programs, (5, -5), (RIGHT, LEFT), strict=True):
        program.SyncMoveOn()
        program.MoveAbsJ(joints(axis_6, axis_7), mpx.v500, mpx.fine)
        program.SyncMoveOff()
    result = site.client.execute_multimove_motion_program(list(programs))
    assert (site.joints("ROB_R")[5], site.joints("ROB_L")[5]) == pytest.approx((5, -5), abs=1e-3)
    assert result.data[-1, [7, 13]] == pytest.approx((5, -5), abs=0.01)


@pytest.mark.parametrize("arms", [1, 2])
def test_a_running_program_is_preempted(site: Any, arms: int) -> None:
    client, angles = site.client, (RIGHT, LEFT)[:arms]
    first = [mpx.MotionProgram() for _ in angles]
    for program, axis_7 in zip(first, angles, strict=True):
        for axis_6 in (2, 4, 6, 8):
            program.MoveAbsJ(joints(axis_6, axis_7), mpx.v100, mpx.fine)
    other = [mpx.MotionProgram(first_cmd_num=3) for _ in angles]
    for program, axis_7 in zip(other, angles, strict=True):
        program.MoveAbsJ(joints(-3, axis_7), mpx.v100, mpx.fine)
    site.flows.clear()
    if arms == 1:
        before = client.execute_motion_program(first[0], wait=False)
    else:
        before = client.execute_multimove_motion_program(first, wait=False)
    site.pass_until(lambda: site.signal("motion_program_queued_cmd_num") == 1)
    assert client.is_motion_program_running()
    assert (client.get_queued_cmdnum(), client.get_current_preempt_number()) == (1, 0)
    if arms == 1:
        client.preempt_motion_program(other[0], preempt_number=1, preempt_cmdnum=2)
    else:
        client.preempt_multimove_motion_program(other, preempt_number=1, preempt_cmdnum=2)
    site.flows.set()
    client.wait_motion_program_complete()
    assert (client.get_current_cmdnum(), client.get_current_preempt_number()) == (3, 1)
    assert site.joints("ROB_R")[5] == pytest.approx(-3, abs=1e-3)
    assert site.joints("ROB_L")[5] == pytest.approx(-3 if arms == 2 else 0, abs=1e-3)
    assert max(client.read_motion_program_result_log(before).data[:, 7]) == pytest.approx(4, abs=0.2)


def test_an_error_of_a_program_reaches_the_client(site: Any) -> None:
    program = mpx.MotionProgram()
    program.MoveL(target(site.client, 3000), mpx.v100, mpx.fine)
    with pytest.raises(Exception, match=r"failed at command 1 with error \d+ in T_ROB1"):
        site.client.execute_motion_program(program)


def test_a_stopped_program_stands_still(site: Any) -> None:
    client = site.client
    program = mpx.MotionProgram()
    program.MoveAbsJ(joints(60), mpx.v10, mpx.fine)
    site.flows.clear()
    before = client.execute_motion_program(program, wait=False)
    site.pass_until(lambda: site.joints("ROB_R")[5] > 1)
    client.stop_motion_program()
    assert not client.is_motion_program_running()
    site.pass_until(lambda: site.world.arms[Side.RIGHT].is_stationary)
    assert 1 < site.joints("ROB_R")[5] < 60
    with pytest.raises(Exception, match="Could not find log file messages"):
        client.read_motion_program_result_log(before)


def test_motions_are_recorded_while_that_is_enabled(site: Any) -> None:
    client, program = site.client, mpx.MotionProgram()
    program.MoveAbsJ(joints(2), mpx.v100, mpx.fine)
    client.disable_motion_logging()
    assert not client.get_motion_logging_enabled()
    assert len(client.execute_motion_program(program).data) == 0
    client.enable_motion_logging()
    assert client.get_motion_logging_enabled()
    program.WaitTime(0.2)
    assert len(client.execute_motion_program(program).data) > 0


def test_egm_goes_on_until_the_client_stops_it(site: Any) -> None:
    client, window = site.client, mpx.egm_minmax(-0.1, 0.1)
    program = mpx.MotionProgram(egm_config=mpx.EGMJointTargetConfig(*[window] * 6, 100, 10))
    program.EGMRunJoint(60, 0.05, 0.05)
    program.MoveAbsJ(joints(2), mpx.v500, mpx.fine)
    site.flows.clear()
    before = client.execute_motion_program(program, wait=False)
    site.pass_until(lambda: site.world.arms[Side.RIGHT].egm is not None)
    assert client.is_motion_program_running()
    client.stop_egm()
    site.flows.set()
    client.wait_motion_program_complete()
    client.read_motion_program_result_log(before)
    assert site.joints("ROB_R")[5] == pytest.approx(2, abs=1e-3)


def test_a_program_as_rapid_text_runs_too(site: Any) -> None:
    client, program = site.client, mpx.MotionProgram()
    program.MoveAbsJ(joints(4), mpx.v1000, mpx.fine)
    program.WaitTime(0.1)
    text = program.get_program_rapid("Generated")
    with site.lock:
        task = site.controller.tasks["T_ROB1"]
        site.controller.files["HOME:/generated.mod"] = text
        site.controller.load_module("T_ROB1", "HOME:/generated.mod", replace=True)
        site.controller.execution.move_pp_to_routine("T_ROB1", "main", "Generated")
    client.abb_client.start(cycle="once", tasks=["T_ROB1"])
    client.wait_motion_program_complete()
    with site.lock:
        site.controller.execution.unload_module("T_ROB1", "Generated")
        assert task.name == "T_ROB1"
    assert site.joints("ROB_R")[5] == pytest.approx(4, abs=1e-3)
