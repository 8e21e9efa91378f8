"""The files a user loads onto a real controller: the text is RAPID, the interface is complete."""

import re
from pathlib import Path

import pytest

import abb_protocols.controller_files
from virtual_irc5.rapid.ast import Module, RoutineKind, Storage
from virtual_irc5.rapid.parser import parse_module
from virtual_irc5.system_parameters import SystemConfiguration

FOLDER = Path(next(iter(abb_protocols.controller_files.__path__)))
MODULES = sorted([*FOLDER.glob("*.mod"), *FOLDER.glob("*.sys")])
CONFIGURATIONS = sorted(FOLDER.glob("*.cfg"))
LONGEST_IDENTIFIER = 32
LONGEST_STRING = 80
SIGNALS = {
    "EGM_START_JOINT": "DI",
    "EGM_START_POSE": "DI",
    "EGM_START_STREAM": "DI",
    "EGM_STOP": "DI",
    "EGM_STOP_STREAM": "DI",
    "RUN_RAPID_ROUTINE": "DI",
    "RUN_SG_ROUTINE": "DI",
    "WD_EXTERNAL_STATUS": "DO",
    "WD_STOP_REQUEST": "DI",
    "OUTPUT_STATIONARY_ROB_R": "DO",
    "OUTPUT_STATIONARY_ROB_L": "DO",
}
SYMBOLS = {
    "TRobMain": {
        "current_state": "num",
        "STATE_IDLE": "num",
        "CHANGE_STATE": "errnum",
        "idle_counter": "num",
    },
    "TRobEGM": {"current_action": "num", "settings": "EGMSettings"},
    "TRobRAPID": {
        "routine_name_input": "string",
        "move_speed_input": "speeddata",
        "move_robtarget_input": "robtarget",
        "move_jointtarget_input": "jointtarget",
        "callbyvar_name_input": "string",
        "callbyvar_num_input": "num",
        "module_file_path_input": "string",
    },
    "TRobSG": {"command_input": "num", "target_position_input": "num", "settings": "SGSettings"},
    "TRobWatchdog": {"active": "bool", "check_external_status": "bool", "external_timeout": "num"},
    "TRobUtility": {"general_info": "GeneralInfo", "calibration_values": "CalibrationValues"},
}


def parsed(path: Path) -> Module:
    return parse_module(path.read_text(encoding="ascii"), path.name)


@pytest.fixture
def configuration() -> SystemConfiguration:
    return SystemConfiguration(path.read_text(encoding="ascii") for path in CONFIGURATIONS)


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.name)
def test_module_is_rapid_named_like_its_file(path: Path) -> None:
    module = parsed(path)
    assert module.name == path.stem


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.name)
def test_only_the_hooks_are_a_system_module(path: Path) -> None:
    """As in ABB's Add-In: main, and what it calls, stand in program modules."""
    assert parsed(path).is_system == (path.suffix == ".sys")


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.name)
def test_module_has_no_identifier_a_controller_would_refuse(path: Path) -> None:
    code = re.sub(r'"[^"]*"|![^\n]*', "", path.read_text(encoding="ascii"))
    too_long = {word for word in re.findall(r"[A-Za-z]\w*", code) if len(word) > LONGEST_IDENTIFIER}
    assert too_long == set()


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.name)
def test_module_has_no_string_a_controller_would_refuse(path: Path) -> None:
    code = re.sub(r"(?m)^\s*![^\n]*", "", path.read_text(encoding="ascii"))
    assert all(len(text) <= LONGEST_STRING for text in re.findall(r'"([^"\n]*)"', code))


@pytest.mark.parametrize("path", [*MODULES, *CONFIGURATIONS], ids=lambda path: path.name)
def test_file_fits_the_screen_and_has_no_tabs(path: Path) -> None:
    text = path.read_text(encoding="ascii")
    assert "\t" not in text
    assert max(len(line) for line in text.splitlines()) <= 120


@pytest.mark.parametrize("name", SYMBOLS)
def test_module_declares_the_symbols_clients_address(name: str) -> None:
    module = parsed(next(path for path in MODULES if path.stem == name))
    declared = {data.name: data.type_name for data in module.data}
    assert {symbol: declared.get(symbol) for symbol in SYMBOLS[name]} == SYMBOLS[name]


def test_states_and_actions_have_the_numbers_clients_know() -> None:
    main = parsed(FOLDER / "TRobMain.mod")
    egm = parsed(FOLDER / "TRobEGM.mod")
    constants = [data for module in (main, egm) for data in module.data if data.storage is Storage.CONST]
    numbers = {data.name: data.initial.value for data in constants if hasattr(data.initial, "value")}
    assert [numbers[f"STATE_{n}"] for n in ("IDLE", "INITIALIZE", "RUN_RAPID_ROUTINE", "RUN_EGM_ROUTINE")] == [
        0,
        1,
        2,
        3,
    ]
    actions = ("NONE", "RUN_JOINT", "RUN_POSE", "STOP", "START_STREAM", "STOP_STREAM")
    assert [numbers[f"ACTION_{name}"] for name in actions] == [0, 1, 2, 3, 4, 5]


def test_signals_are_those_of_the_add_in_and_virtual(configuration: SystemConfiguration) -> None:
    instances = configuration.instances("EIO", "EIO_SIGNAL")
    assert {instance.name: instance.attributes["SignalType"] for instance in instances} == SIGNALS
    assert {instance.attributes["Device"] for instance in instances} == {""}


def test_signals_that_clients_raise_are_open_to_them(configuration: SystemConfiguration) -> None:
    access = {i.name: i.attributes["Access"] for i in configuration.instances("EIO", "EIO_SIGNAL")}
    raised = {name for name in SIGNALS if not name.startswith("OUTPUT_STATIONARY")}
    assert {name for name, level in access.items() if level == "All"} == raised


@pytest.mark.parametrize(("unit", "port"), [("ROB_L", "6511"), ("ROB_R", "6512")])
def test_each_arm_has_an_egm_device_of_its_own(configuration: SystemConfiguration, unit: str, port: str) -> None:
    device = configuration.find("SIO", "COM_TRP", unit)
    assert device is not None
    assert (device.attributes["Type"], device.attributes["RemotePortNumber"]) == ("UDPUC", port)


def test_egm_devices_have_the_attributes_of_robotware_6_only(configuration: SystemConfiguration) -> None:
    attributes = {name for device in configuration.instances("SIO", "COM_TRP") for name in device.attributes}
    assert attributes == {"Name", "Type", "PhyChannel", "RemoteAdress", "RemotePortNumber"}


@pytest.mark.parametrize("name", ["ROB_R", "ROB_R_RAW", "ROB_L", "ROB_L_RAW"])
def test_each_arm_has_filtered_and_raw_motion_data(configuration: SystemConfiguration, name: str) -> None:
    data = configuration.find("MOC", "EXT_MOTION_DATA", name)
    assert data is not None
    assert data.attributes["ext_motion_level"] == ("0" if name.endswith("RAW") else "1")


def test_every_module_is_loaded_into_the_motion_tasks(configuration: SystemConfiguration) -> None:
    instances = configuration.instances("SYS", "CAB_TASK_MODULES")
    loaded = {instance.attributes["File"].rsplit("/")[-1] for instance in instances}
    assert loaded == {path.name for path in MODULES}


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.name)
def test_trap_that_changes_the_state_leaves_its_level_by_a_long_jump(path: Path) -> None:
    """A controller lets an error out of a trap only when the trap's own handler raises it again."""
    traps = [routine for routine in parsed(path).routines if routine.kind is RoutineKind.TRAP]
    raising = [trap for trap in traps if "Raise(" in repr(trap.body)]
    handlers = [trap.handler for trap in raising if trap.handler is not None]
    assert len(handlers) == len(raising)
    assert all(handler.numbers and "Raise(" in repr(handler.body) for handler in handlers)
