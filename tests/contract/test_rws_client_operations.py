"""Every operation of the virtual controller's table has a typed call, whose values are those of the controller."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime

import pytest

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, ControllerRefused, NoConnection
from abb_protocols.robot.joints import Joints, Pose, Side, home
from abb_protocols.robot.kinematics import tool0_to_body
from abb_protocols.rws.documents import Pairs
from abb_protocols.rws.operations import ctrl, event_log, modules, motion, queues
from abb_protocols.rws.operations.modules import TextRange
from abb_protocols.rws.operations.motion import RobTarget, Supervision
from abb_protocols.rws.operations.operation import Operation
from abb_protocols.rws.operations.queues import QueueMessage
from abb_protocols.rws.values import (
    Coordinates,
    Increment,
    JogMode,
    OperatingMode,
    Privilege,
    RestartMode,
    RmmpStatus,
    RunCycle,
    RwsCode,
    SignalChange,
    SignalType,
    Step,
    StopMode,
    SymbolKind,
)
from abb_runtime.clock import ManualClock
from abb_runtime.faults import DISPLAY_PATH
from abb_runtime.rws.client import OPERATING_MODE, RwsClient
from memory_http import MemoryHttp
from refusals import refused
from virtual_irc5.rws.router import Route
from virtual_irc5.world import World

TASK = "T_ROB_L"
SMALL = "MODULE Small\n  VAR num count := 1;\n  PROC small()\n    count := 2;\n  ENDPROC\nENDMODULE\n"
BROKEN = "MODULE Broken\n  PROC broken()\n    nowhere;\n  ENDPROC\nENDMODULE\n"
ASKS = 'MODULE Asks\n PROC main()\n  VAR num answer;\n  TPReadNum answer, "How many?";\n ENDPROC\nENDMODULE\n'

INDEX_PAGES = {
    "/", "/rw", "/rw/panel", "/rw/rapid", "/rw/iosystem", "/rw/rapid/symbols", "/rw/rapid/uiinstr", "/ctrl",
    "/ctrl/backup", "/ctrl/compress", "/ctrl/diagnostics", "/rw/rapid/tasks/{task}/motion", "/progress",
    "/ctrl/options",
}  # fmt: skip
"""What only lists the resources below it."""

OTHER_SPELLINGS = {
    ("GET", "/rw/rapid/tasks/{task}", None, "task-struc-change-count"),
    ("GET", "/rw/rapid/tasks/{task}/activation-record", None, None),
    ("GET", "/rw/rapid/tasks/{task}/breakpoints", None, None),
    ("POST", "/rw/motionsystem", "set-target", None),
    ("POST", "/rw/motionsystem/nonmotionexecution", "set", None),
    ("POST", "/rw/motionsystem/mechunits/{unit}", "CalcRobTFromJoints", None),
    ("POST", "/ctrl/clock/timezone", None, None),
    ("GET", "/subscription/{group}", None, None),  # a subscription knows what it is for
    ("PUT", "/subscription/{group}", None, None),
    ("DELETE", "/subscription/{group}/{resource:.+}", None, None),
}
"""Operations that another one does as well."""


class Bench:
    """A client of a virtual YuMi without sockets, and the operations that it has been asked for."""

    def __init__(self) -> None:
        self.world = World()
        self.controller = self.world.controller
        clock = Ticking(self)
        self.http = MemoryHttp(self.controller, clock)
        self.used: dict[int, Operation] = {}
        find = self.http.adapter._router.find

        def found(method: str, path: Sequence[str], query: Pairs) -> tuple[Route, Mapping[str, str]]:
            route, names = find(method, path, query)
            self.used[id(route.operation)] = route.operation
            return route, names

        self.http.adapter._router.find = found  # type: ignore[method-assign]
        self.client = RwsClient(self.http, clock=clock)
        self.client.connect()

    def cycles(self, count: int = 3) -> None:
        for _ in range(count):
            self.world.cycle({})


class Ticking(ManualClock):
    """Waits at once, and the controller goes on meanwhile."""

    def __init__(self, bench: Bench) -> None:
        super().__init__()
        self.bench = bench

    def wait(self, duration: float) -> None:
        self.advance(duration)
        self.bench.controller.jobs.advance(duration)
        self.bench.http.adapter.advance(self.now())


@pytest.fixture(scope="module")
def bench() -> Iterator[Bench]:
    bench = Bench()
    yield bench
    bench.client.close()


@pytest.fixture(scope="module")
def client(bench: Bench) -> RwsClient:
    return bench.client


def test_panel(client: RwsClient, bench: Bench) -> None:
    assert client.operating_mode() is OperatingMode.AUTO
    client.set_speed_ratio(50)
    assert (client.speed_ratio(), client.collision_state().name) == (50, "INIT")
    client.set_speed_ratio(100)
    with refused(ControllerRefused, "rws_refused", reason=message("rws_mode_reject")):  # no change waits for it
        client.acknowledge_operating_mode(OperatingMode.AUTO)
    with refused(CommandRefused, "mode_needs_no_confirmation", mode="MANR"):
        client.acknowledge_operating_mode(OperatingMode.MANUAL_REDUCED)
    client.acknowledge_collision()
    client.lock_operating_mode("1234", permanent=True)
    assert client.is_operating_mode_locked()
    client.unlock_operating_mode("1234")
    assert not client.is_operating_mode_locked()
    client.set_language("de")
    assert bench.controller.own_settings.language == "de"


def test_execution_with_all_its_arguments(client: RwsClient, bench: Bench) -> None:
    client.set_motors(True)
    assert client.controller_state().value == "motoron"
    client.move_pp_to_main()
    client.set_run_cycle(RunCycle.ONCE)
    assert client.run_cycle() is RunCycle.ONCE
    client.set_run_cycle(RunCycle.FOREVER)
    client.start_rapid(step=Step.OVER)
    bench.cycles()
    assert client.execution().value == "stopped"
    client.start_from_production_entry()
    bench.cycles()
    assert client.execution().value == "running"
    client.stop_rapid(StopMode.INSTRUCTION, all_tasks=True)
    bench.cycles()
    assert client.execution().value == "stopped"
    assert client.may_select_tasks()
    assert client.alias_signals() == {}


def test_tasks(client: RwsClient, bench: Bench) -> None:
    client.move_pp_to_main()
    assert [task.name for task in client.tasks()] == ["T_ROB_R", TASK]
    client.select_task(TASK, False)
    assert not client.task(TASK).is_active
    client.select_task(TASK, True)
    assert client.task(TASK).is_active
    client.select_all_tasks(False)
    assert [task.is_active for task in client.tasks()] == [False, False]
    client.select_all_tasks(True)
    assert [task.is_active for task in client.tasks()] == [True, True]
    assert client.task(TASK).is_motion_task
    assert client.task_change_count(TASK) >= 0
    assert not client.is_synchronized()
    assert not client.is_synchronized(TASK)
    assert not client.is_spy_running()
    frame = client.stack_frame(TASK)
    assert (frame.module, frame.routine) == ("TRobMain", "main")
    assert "main" in client.service_routines(TASK)
    assert client.preferred_type(TASK, "MoveAbsJ", "Speed") == "speeddata"
    assert client.task_place(TASK)[:2] == ("TRobMain", "main")
    assert client.task_joint_target(TASK) == pytest.approx(home(Side.LEFT), abs=1e-4)
    assert client.task_units(TASK) == ("ROB_L", "ROB_L_7")
    assert client.external_joints(TASK)[:2] == ("rotating", "not_active")
    client.abort_execution_level(TASK)


def test_programs_and_pointers(client: RwsClient, bench: Bench) -> None:
    client.upload("HOME:/small.mod", SMALL)
    client.upload("HOME:/broken.mod", BROKEN)
    client.upload("HOME:/small.pgf", "<?xml version='1.0'?><Program><Module>small.mod</Module></Program>")
    client.load_module(TASK, "HOME:/small.mod")
    program = client.program(TASK)
    assert program is not None
    assert program.entry == "main"
    client.rename_program(TASK, "other")
    client.set_entry(TASK, "small")
    client.set_entry(TASK, "main")
    client.move_pp_to_routine(TASK, "Small", "small")
    pointer, _ = client.pointers(TASK)
    assert (pointer.module, pointer.routine, pointer.range) == ("Small", "small", TextRange(4, 5, 4, 15))
    client.move_pp_to_routine(TASK, "Small", f"RAPID/{TASK}/Small/small", keeps_calls=True)
    client.move_pp_to_cursor(TASK, "Small", "small", 4)
    for _ in range(2):  # the second time nothing changes
        client.set_breakpoint(TASK, "Small", 4)
        assert client.breakpoints(TASK) == (("Small", TextRange(4, 5, 4, 15)),)
    with pytest.raises(ControllerRefused) as refused:
        client.set_breakpoint(TASK, "Small", 3)
    assert refused.value.code == RwsCode.SOURCEPOS
    client.clear_breakpoint(TASK, "Small", TextRange(4, 5, 4, 15))
    assert client.breakpoints(TASK) == ()
    assert client.pointers(TASK)[0].range is None, "the program pointer was in the text"
    assert client.build(TASK) == ()
    client.save_program(TASK, "HOME:/saved")
    client.unload_program(TASK)
    client.load_program(TASK, "HOME:/small.pgf", replace=False)
    assert "Small" in [module.name for module in client.modules(TASK)]
    client.unload_module(TASK, "Small")
    bench.controller.replace_program({})


def test_faults_of_a_program_are_values(client: RwsClient, bench: Bench) -> None:
    client.upload("HOME:/broken.mod", BROKEN)
    client.load_module(TASK, "HOME:/broken.mod")
    (fault,) = client.build(TASK)
    assert (fault.row, "nowhere" in fault.message) == (3, True)
    client.unload_module(TASK, "Broken")
    bench.controller.replace_program({})


def test_modules_and_their_text(client: RwsClient) -> None:
    client.upload("HOME:/small.mod", SMALL)
    client.load_module(TASK, "HOME:/small.mod")
    assert client.module(TASK, "Small").name == "Small"
    assert client.module_text(TASK, "Small").split() == SMALL.split()
    assert client.module_part(TASK, "Small", TextRange(3, 3, 3, -1)).strip() == "PROC small()"
    assert client.find_text(TASK, "Small", "count :=") == (2, 11)
    assert client.module_object(TASK, "Small", 4, 6).row == 3
    before = client.module_change_count(TASK, "Small")
    client.replace_text(TASK, "Small", TextRange(4, 5, 4, 15), "count := 3;")
    assert client.module_change_count(TASK, "Small") > before
    assert "count := 3;" in client.module_text(TASK, "Small")
    assert client.module_size(TASK, "Small")[0] == 6
    assert client.are_initial_values_current(TASK, "Small")
    assert client.symbol_at(TASK, "Small", 2, 12) == "count"
    assert client.routine_at(TASK, "Small", 4).name == "small"
    assert [each.name for each in client.routines(TASK, "Small")] == ["small"]
    client.save_module(TASK, "Small", "HOME:/", "Kept")
    assert "count := 3;" in client.download("HOME:/Kept.mod")
    client.set_module_text(TASK, "Small", SMALL)
    assert "count := 2;" in client.module_text(TASK, "Small")
    client.unload_module(TASK, "Small")


def test_symbols(client: RwsClient, bench: Bench) -> None:
    assert client.symbol_type(TASK, "TRobMain", "current_state") == "num"
    info = client.symbol_properties(TASK, "TRobMain", "current_state")
    assert (info.kind, info.type, info.dimensions, info.is_read_only) == (SymbolKind.VARIABLE, "num", (), False)
    client.set_value(TASK, "TRobMain", "current_state", 2.0)
    assert client.value(TASK, "TRobMain", "current_state") == 2.0
    names = [each.name for each in client.find_symbols(f"RAPID/{TASK}", kind=SymbolKind.PERSISTENT, type="tooldata")]
    assert "egm_tool" in names
    assert client.is_value_of(TASK, "[[0,0,0],[1,0,0,0]]", "pose")
    assert not client.is_value_of(TASK, "TRUE", "pose")
    client.set_initial_value(TASK, "TRobEGM", "egm_presync_tasks", (("T_ROB_L",), ("T_ROB_R",)))
    bench.controller.replace_program({})


def test_dialog_is_read_and_answered(client: RwsClient, bench: Bench) -> None:
    assert client.dialog() is None
    bench.controller.files["HOME:/asks.mod"] = ASKS
    bench.controller.replace_program({"HOME:/asks.mod": ASKS})
    client.set_motors(True)
    client.start_rapid()
    bench.cycles(1)
    dialog = client.dialog()
    assert dialog is not None
    assert (dialog.instruction, dialog.message) == ("TPReadNum", "How many?")
    assert client.dialog_parameters(dialog.stack)["Result"] == client.dialog_parameter(dialog.stack, "Result") == ""
    client.answer_dialog(dialog.stack, "3")
    bench.cycles()
    other = client.dialog()  # of the other arm's task, which has asked, too
    assert other is not None
    assert other.stack != dialog.stack
    client.stop_rapid()
    bench.cycles()
    assert client.execution().value == "stopped"
    bench.controller.replace_program({})


def test_signals_devices_networks(client: RwsClient) -> None:
    name = "custom_DO_0"
    client.set_signal(name, 1)
    details = client.signal_details(name)
    assert (details.signal.value, details.is_valid, details.is_simulated, details.device) == (1, True, False, "D652_10")
    client.change_signal(name, SignalChange.INVERT)
    assert client.signal(name).value == 0
    client.change_signal(name, SignalChange.PULSE, 1, pulses=1, active=0.1, passive=0.1)
    assert client.signal_access(name).remote_auto
    client.simulate_signal("custom_DI_0", True)
    assert client.signal_details("custom_DI_0").is_simulated
    client.unblock_signals()
    assert not client.signal_details("custom_DI_0").is_simulated
    assert {each.name for each in client.find_signals("hand_Cmd", type=SignalType.GROUP_OUTPUT)} < set(client.signals())
    assert {each.signal.name[-2:] for each in client.find_signal_details("hand", "_R")} == {"_R"}
    assert "DeviceNet" in [network.name for network in client.networks()]
    assert [network.name for network in client.networks("Local")] == ["Local"]
    assert client.network("DeviceNet").is_running
    assert client.network_type("DeviceNet") == "DEV"
    client.start_network("DeviceNet", False)
    assert not client.network("DeviceNet").is_running
    client.start_network("DeviceNet", True)
    assert client.network("DeviceNet").is_running
    client.configure_network("DeviceNet")
    assert "D652_10" in [device.name for device in client.devices()]
    assert {device.name for device in client.devices(network="DeviceNet")} == {"D652_10"}
    assert [device.name for device in client.devices("D652")] == ["D652_10"]
    client.enable_device("D652_10", False)
    assert not client.device("DeviceNet/D652_10").is_enabled
    client.enable_device("D652_10", True)
    assert client.device("DeviceNet/D652_10").is_enabled
    assert client.device("DeviceNet/D652_10").address == "10"
    assert client.device_access("DeviceNet/D652_10").rapid
    assert not client.has_upgrade("DeviceNet", "D652_10")


def test_positions_and_kinematics_are_those_of_the_arm(client: RwsClient) -> None:
    position: Joints = client.joint_target("ROB_L")
    assert client.physical_joints("ROB_L") == pytest.approx(position, abs=1e-4)
    # Against the kinematics of this package: the controller's tool0 is in its base, which is the body.
    expected = tool0_to_body(Side.LEFT, position).position
    target = client.rob_target("ROB_L", tool="tool0", work_object="wobj0", coordinates=Coordinates.BASE)
    assert target.tool_to_object.position == pytest.approx(expected, abs=1e-5)
    assert client.cartesian("ROB_L").tool_to_object.position == pytest.approx(expected, abs=1e-5)
    assert client.task_rob_target(TASK, "tool0").tool_to_object.position == pytest.approx(expected, abs=1e-5)
    computed = client.pose_of_joints("ROB_L", position)
    assert computed.tool_to_object.position == pytest.approx(expected, abs=1e-5)
    assert client.joints_of_pose("ROB_L", computed, position) == pytest.approx(position, abs=1e-3)
    assert client.joints_of_cartesian("ROB_L", computed, position) == pytest.approx(position, abs=1e-3)
    assert any(each == pytest.approx(position, abs=1e-3) for each in client.all_joints_of_pose("ROB_L", computed))
    mounted = client.base_frame("ROB_L")
    assert mounted == Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    for frame in (Pose((0.1, -0.2, 0.3), (0.0, 0.6, 0.0, 0.8)), mounted):
        client.set_base_frame("ROB_L", frame)
        attributes = client.cfg_instance("MOC", "ROBOT", "ROB_L").attributes
        position = [float(attributes[f"base_frame_pos_{axis}"]) for axis in "xyz"]
        orientation = [float(attributes[f"base_frame_orient_u{number}"]) for number in range(4)]
        assert (position, orientation) == (pytest.approx(frame.position), pytest.approx(frame.orientation))
        assert client.base_frame("ROB_L") == mounted  # another one acts after a restart
    assert client.axes("ROB_L") == 6
    assert client.is_axis_synchronized("ROB_L", 1)
    assert all(abs(length) < 1.0 for length in client.axis_pose("ROB_L", 1).position)


@pytest.mark.parametrize("supervision", [Supervision(False, 80), Supervision(True, 100)], ids=["off", "on"])
@pytest.mark.parametrize("kind", ["motion", "path"])
def test_supervision_is_read_as_it_was_set(client: RwsClient, kind: str, supervision: Supervision) -> None:
    getattr(client, f"set_{kind}_supervision")("ROB_L", supervision)
    assert getattr(client, f"{kind}_supervision")("ROB_L") == supervision


def test_operation_of_a_table_is_performed_without_a_call_of_its_own(client: RwsClient) -> None:
    client.perform(motion.SET_UNIT_LEAD_THROUGH, "ROB_L", status="active")
    assert client.perform(motion.UNIT_LEAD_THROUGH, "ROB_L") is True
    client.perform(motion.SET_UNIT_LEAD_THROUGH, "ROB_L", status="inactive")
    supervision = client.perform(motion.PATH_SUPERVISION, mechunit="ROB_L")
    assert supervision == client.path_supervision("ROB_L")


def test_operation_that_shows_a_list_or_perhaps_nothing_is_performed_without_a_value(client: RwsClient) -> None:
    client.create_queue("performed")
    assert client.perform(queues.READ_QUEUE, "performed") is None
    client.remove_queue("performed")
    assert client.perform(modules.MODULE_ROUTINES, TASK, "TRobMain") is None
    assert client.perform(event_log.LOGS) is None
    assert client.perform(ctrl.NETWORK) is None


def test_units_supervision_calibration(client: RwsClient, bench: Bench) -> None:
    assert client.mechanical_units() == ("ROB_R", "ROB_L", "ROB_R_7", "ROB_L_7")
    client.set_mechanical_unit("ROB_L", tool="tool0", coordinates=Coordinates.TOOL, jog_mode=JogMode.AXES_1_TO_3)
    unit = client.mechanical_unit("ROB_L")
    assert (unit.total_axes, unit.integrated_unit, unit.coordinates) == (7, "ROB_L_7", Coordinates.TOOL)
    client.set_lead_through("ROB_L", True)
    assert client.is_lead_through_on("ROB_L")
    client.set_lead_through("ROB_L", False)
    assert not client.is_lead_through_on("ROB_L")
    client.predict_collisions(False)
    assert not client.is_collision_predicted()
    client.predict_collisions(True)
    assert client.is_collision_predicted()
    with pytest.raises(ControllerRefused) as refused:
        client.skip_motion(True)
    assert refused.value.code == RwsCode.NOTIMPL
    bench.controller.motion.is_non_motion = True  # which this controller does not do when it is asked to
    assert client.is_motion_skipped()
    client.skip_motion(False)
    assert not client.is_motion_skipped()
    assert [each.joint for each in client.calibration("ROB_L")] == [f"rob_L_{axis}" for axis in range(1, 7)]
    assert client.is_measurement_memory_valid("ROB_L")
    assert len(client.calibrated_motors("ROB_L")) == 6
    assert client.motion_error() == ("HPJ_OK", 0)


def test_jogging(client: RwsClient, bench: Bench) -> None:
    client.stop_rapid()
    bench.cycles()
    client.set_motors(True)
    client.select_unit("ROB_L")
    system = client.motion_system()
    assert system.unit == "ROB_L"
    assert not client.has_motion_changed(system.change_count)
    before = client.joint_target("ROB_L")
    client.jog([1000, 0, 0, 0, 0, 0], Increment.LARGE, system.change_count)
    bench.cycles(100)
    moved = client.joint_target("ROB_L")
    assert moved[0] > before[0]
    computed = client.pose_of_joints("ROB_L", before)
    client.jog_to(RobTarget(computed.tool_to_object, computed.configuration, computed.external))
    bench.cycles(400)
    assert client.joint_target("ROB_L") == pytest.approx(before, abs=1e-3)
    client.set_motors(False)


def test_configuration(client: RwsClient) -> None:
    assert "SIO" in client.cfg_domains()
    assert "COM_TRP" in client.cfg_types("SIO")
    attributes, instances = client.cfg_size("SIO", "COM_TRP")
    assert len(client.cfg_attributes("SIO", "COM_TRP")) == attributes
    assert len(client.cfg("SIO", "COM_TRP")) == instances
    client.create_cfg("SIO", "COM_TRP", "NEW")
    client.set_cfg("SIO", "COM_TRP", "NEW", {"RemotePortNumber": "6599"})
    assert client.cfg_instance("SIO", "COM_TRP", "NEW").attributes["RemotePortNumber"] == "6599"
    client.save_cfg("SIO", "HOME:/sio.cfg")
    assert client.check_cfg_file("HOME:/sio.cfg", replace=True)
    assert not client.check_cfg_file("HOME:/none.cfg")
    client.load_cfg("HOME:/sio.cfg", replace=True)
    assert client.can_change_cfg("SIO", "COM_TRP", ["NEW"])
    assert client.can_remove_cfg("NEW")
    client.remove_cfg("SIO", "COM_TRP", "NEW")
    lines = client.cfg("SYS", "CAB_TASK_MODULES")  # listed with defaulted attributes, saved without them
    of_all_tasks = {each.attributes["ModName"]: each.attributes["AllTask"] for each in lines}
    assert of_all_tasks.pop("user") == "TRUE"
    assert set(of_all_tasks.values()) == {"false"}
    assert client.cfg_size("SYS", "CAB_TASK_MODULES") == (len(lines[0].attributes), len(lines))
    client.save_cfg("SYS", "HOME:/sys.cfg")
    assert client.download("HOME:/sys.cfg").count("-AllTask") == 1
    client.reset_cfg("PROC")
    client.reset_cfg("MOC", "ARM")


def test_controller_settings(client: RwsClient, bench: Bench) -> None:
    client.set_identity(name="14000-500000")
    assert client.identity().name == "14000-500000"
    assert client.environment("HOME") == "HOME:"
    client.set_controller_language("en")
    client.set_timezone("UTC")
    assert client.timezone() == "UTC"
    client.set_clock(datetime(2026, 7, 9, 1, 2, 3))
    assert client.clock() == datetime(2026, 7, 9, 1, 2, 3)
    client.set_time_server("10.0.0.1")
    assert client.time_server() == "10.0.0.1"
    with pytest.raises(ControllerRefused):
        client.set_network("fixip", address="nowhere", mask="255.0.0.0", gateway="10.0.0.1")
    client.set_network("fixip", address="10.0.0.2", mask="255.0.0.0", gateway="10.0.0.1")
    assert "192.168.125.1" in [port.address for port in client.network_ports()]
    assert client.name_server() == ""
    client.add_route("10.1.0.0/16", "10.0.0.1")
    assert client.routes() == {"10.1.0.0/16": "10.0.0.1"}
    client.remove_route("10.1.0.0/16")
    assert client.systems() == ("YuMi",)
    client.rename_system("YuMi", "Lab")
    assert client.installed_system("Lab").robotware[:2] == (6, 13)
    client.rename_system("Lab", "YuMi")
    assert client.has_option("Leadthrough")
    assert not client.has_option("Nothing")
    assert client.options() == client.system().options
    assert client.is_compatible()
    assert client.is_compatible("6.09.0101")
    assert not client.has_safety_controller()
    assert client.robot_types() == ("IRB 14000-0.5/0.5",)
    assert client.license()
    assert "RobotWare" in client.products()
    client.reset_energy()
    assert client.energy().total == 0.0
    assert client.energy_change_count() >= 0
    assert any(each.code == -1073445862 and "RESOURCE_HELD" in each.name for each in client.return_codes())
    assert client.hardware() == ("HW_DEVICES", "SW_RESOURCES")
    assert client.hardware_properties("HW_DEVICES/CONTROLLER")["Name"]


def test_jobs_end_before_their_calls_return(client: RwsClient) -> None:
    progress: list[str] = []
    where = client.backup("monday", progress.append)
    assert progress[-1] == "Ready"
    assert client.backup_state() == "Backup Ready"
    assert client.backup_system("monday") == "YuMi"
    assert client.can_restore("monday")
    assert client.files(where)
    client.upload("HOME:/x.txt", "text")
    client.compress("HOME:/x.txt", "TEMP:/x.rzo")
    client.decompress("TEMP:/x.rzo", "TEMP:/")
    client.save_diagnostics("TEMP:/diagnostics.log")
    client.save_events("TEMP:/log.txt")
    assert client.has_file("TEMP:/diagnostics.log")


def test_files(client: RwsClient) -> None:
    assert {volume.name for volume in client.volumes()} >= {"HOME", "TEMP", "BACKUP"}
    client.make_directory("HOME:/new")
    client.write_file("HOME:/new/a.txt", b"\x00bytes")
    client.copy_file("HOME:/new/a.txt", "b.txt")
    client.rename_file("HOME:/new/b.txt", "c.txt")
    assert client.read_file("HOME:/new/c.txt") == b"\x00bytes"
    assert [entry.name for entry in client.files("HOME:/new")] == ["a.txt", "c.txt"]
    client.delete_file("HOME:/new")
    assert not client.has_file("HOME:/new/a.txt")


def test_event_log(client: RwsClient, bench: Bench) -> None:
    bench.controller.events.append(10010, "Motors OFF")
    (newest,) = client.events(count=1)
    assert client.event(newest.number) == newest
    assert {domain.number for domain in client.event_domains()} >= {0, 1}
    client.clear_events(1)
    client.clear_all_events()
    assert client.events() == ()


def test_queues(client: RwsClient) -> None:
    client.create_queue("mine", size=5)
    assert client.queue("mine").size == 5
    assert {"mine", f"RMQ_{TASK}"} <= set(client.queues())
    assert client.read_message("mine") is None
    client.send_message("mine", "num;5", sender="mine", user_def=7)
    assert client.read_message("mine", timeout=0.1) == QueueMessage("num;5", 7, "mine")
    client.remove_queue("mine")
    assert "mine" not in client.queues()


def test_users_and_the_privilege_in_manual_mode(client: RwsClient, bench: Bench) -> None:
    client.register(application="test", location="here")
    (user,) = client.users()
    assert (user.application, user.location, user.is_local) == ("test", "here", False)
    assert "UAS_RAPID_EXECUTE" in client.grants()
    assert client.rmmp().privilege == "none"
    with refused(ControllerRefused, "no_privilege_requested", address=client.address) as caught:
        client.poll_rmmp()
    assert caught.value.code == RwsCode.NO_SUCH_REQUEST
    bench.controller.select_mode(OperatingMode.MANUAL_REDUCED)
    with pytest.raises(ControllerRefused), client.holding("rapid"):
        pass
    client.request_rmmp(Privilege.MODIFY)
    assert client.poll_rmmp() is RmmpStatus.PENDING
    with RwsClient(bench.http, clock=bench.client._clock) as pendant:
        pendant.register("FlexPendant", is_local=True)
        pendant.grant_rmmp(user.uid, Privilege.MODIFY)
    assert client.poll_rmmp() is RmmpStatus.GRANTED
    assert client.rmmp().is_own
    with client.holding("rapid"), client.holding("rapid"):
        assert client.mastership("rapid") == ""
    client.cancel_rmmp()
    late = refused(NoConnection, "privilege_not_granted", timeout=0.0)
    with late, client.holding_rmmp(timeout=0.0):
        pass
    assert client.rmmp().privilege == "none"
    bench.controller.select_mode(OperatingMode.AUTO)
    client.log_in_remotely()
    client.log_out_remotely()
    client.register(is_local=True)
    client.set_local(False)
    client.impersonate(user.uid)


def test_lines_on_the_flexpendant_of_a_virtual_controller(client: RwsClient, bench: Bench) -> None:
    host = bench.controller.execution.installed["T_ROB_L"].host
    before = host.line_count
    for number in range(1, 43):
        host.write_text("T_ROB_L", f"line {number}")
    entries = [each for each in client.entries(DISPLAY_PATH) if each.text("task") == "T_ROB_L"]
    shown = [(each.whole("number"), each.text("text")) for each in entries]
    assert shown == [(before + number, f"line {number}") for number in range(13, 43)]


def test_masterships(client: RwsClient, bench: Bench) -> None:
    assert client.mastership_domains() == ("cfg", "motion", "rapid")
    client.request_all_masterships()
    with RwsClient(bench.http, clock=bench.client._clock) as other:
        assert other.mastership("cfg") != ""
    client.release_all_masterships()


def test_operations_left_are_index_pages_and_what_is_refused_always(client: RwsClient, bench: Bench) -> None:
    """The last test of this module: what none of the others has asked for."""
    subscription = client.subscribe([OPERATING_MODE], lambda change: None, lambda reason: None)
    subscription.close()
    client.restart_controller()
    bench.controller._restart_left = 0.0
    client.restart(RestartMode.WARM)
    bench.controller._restart_left = 0.0
    client.restore("monday")
    client.log_out()
    left = [
        (each.method, each.path, each.action, each.resource)
        for each in bench.http.adapter.operations
        if id(each) not in bench.used and each.success < 400 and each.method != "OPTIONS"
    ]
    assert [
        each for each in left if each not in OTHER_SPELLINGS and not (each[0] == "GET" and each[1] in INDEX_PAGES)
    ] == []
    assert len(bench.used) >= 225
