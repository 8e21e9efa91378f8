"""Bring-up and EGM against the virtual controller: real RAPID, real RWS documents, virtual time."""

from __future__ import annotations

from dataclasses import replace

import pytest

from abb_protocols.catalogue import message
from abb_protocols.errors import ControllerRefused, RobotNotReady, SettingsError
from abb_protocols.robot.joints import Side
from abb_protocols.rws import rapid_values
from abb_protocols.rws.values import GRANTS, ControllerState, ExecutionState, Grant, OperatingMode
from refusals import refused
from system.virtual_time_bench import System
from virtual_irc5.rapid.types import UnknownSymbol
from yumi.driver.bringup import Bringup
from yumi.driver.commissioning.controller_checks import NEEDED_GRANTS
from yumi.driver.launch_checks import EgmAddress
from yumi.driver.state_machine import EGM_MODULE, EgmMotionSettings, MachineState


@pytest.fixture
def system() -> System:
    return System()


def test_bringup_switches_on_starts_and_waits_for_idle(system: System) -> None:
    system.bringup.make_ready()
    assert system.steps == ["switch the motors on", "move the program pointers to main", "start the RAPID program"]
    assert system.client.controller_state() is ControllerState.MOTORS_ON
    assert system.client.execution() is ExecutionState.RUNNING
    assert [system.bringup.machines.state(side) for side in Side] == [MachineState.IDLE, MachineState.IDLE]


def test_what_bringup_will_do_is_known_before_it_is_done(system: System) -> None:
    expected = ["switch the motors on", "move the program pointers to main", "start the RAPID program"]
    before = len(system.client.events())
    assert system.manager.steps_to_ready() == expected
    assert len(system.client.events()) == before  # nothing was done
    system.bringup.make_ready()
    assert system.steps == expected
    assert system.manager.steps_to_ready() == []


def test_only_what_will_be_done_is_announced(system: System) -> None:
    system.client.set_motors(True)
    assert system.manager.steps_to_ready() == ["move the program pointers to main", "start the RAPID program"]
    system.start_egm()
    system.start_driver()  # a new one finds a motion that was left behind
    assert system.manager.steps_to_ready() == ["end the EGM motion that runs (the arms come to rest)"]
    system.manager.make_ready()
    assert system.steps[-1] == "end the EGM motion that runs (the arms come to rest)"


@pytest.mark.parametrize("stop", ["manual", "emergency stop"])
def test_nothing_is_announced_for_a_robot_that_will_be_left_as_it_is(system: System, stop: str) -> None:
    if stop == "manual":
        system.world.controller.mode = OperatingMode.MANUAL_REDUCED
    else:
        system.world.controller.press_emergency_stop()
    assert system.manager.steps_to_ready() == []
    with pytest.raises(RobotNotReady):
        system.bringup.make_ready()


def test_manager_that_was_only_asked_what_it_knows_has_not_acted(system: System) -> None:
    system.manager.steps_to_ready()
    system.manager.state()
    assert not system.manager.has_acted
    system.manager.make_ready()
    assert system.manager.has_acted


def test_datagrams_that_go_elsewhere_are_warned_of_once(system: System) -> None:
    warnings: list[str] = []
    bringup = Bringup(system.client, EgmMotionSettings(), system, system.steps.append, warn=warnings.append)
    bringup.check_controller({Side.LEFT: EgmAddress("192.0.2.1", 6511)})
    bringup.make_ready()
    bringup.make_ready()
    said = message(
        "datagrams_go_elsewhere", arm="left", there="127.0.0.1:6511", here="192.0.2.1:6511", device=Side.LEFT.unit
    )
    assert warnings == [str(said)]
    assert not any("datagrams" in step for step in system.steps)


def test_bringup_does_nothing_to_a_robot_that_is_ready(system: System) -> None:
    system.bringup.make_ready()
    system.steps.clear()
    system.bringup.make_ready()
    assert system.steps == []


def test_bringup_says_why_the_robot_is_not_ready(system: System) -> None:
    assert system.manager.state().reasons == (message("motors_off"),)
    system.client.set_motors(True)
    system.wait(1.0)
    assert system.manager.state().reasons == (message("program_stopped"),)
    system.bringup.make_ready()
    assert system.manager.state().reasons == ()


def test_bringup_says_that_only_the_flexpendant_chooses_auto(system: System) -> None:
    system.world.controller.mode = OperatingMode.MANUAL_REDUCED
    with refused(RobotNotReady, "cannot_bring_up", reason=message("not_in_auto", mode="MANR")):
        system.bringup.make_ready()
    assert system.manager.state().reasons == (message("not_in_auto", mode="MANR"),)


def test_bringup_refuses_a_controller_without_egm(system: System) -> None:
    controller = system.world.controller
    options = tuple(option for option in controller.identity.options if not option.startswith("689-1"))
    controller.identity = replace(controller.identity, options=options)
    with refused(RobotNotReady, "option_missing", option="689-1 Externally Guided Motion (EGM)"):
        system.bringup.check_controller()


def test_bringup_refuses_a_robotware_that_is_too_old(system: System) -> None:
    controller = system.world.controller
    controller.identity = replace(controller.identity, robotware="6.08.01.00")
    with refused(RobotNotReady, "robotware_too_old", version="6.8.1.0", oldest="6.09"):
        system.bringup.check_controller()


def test_bringup_says_that_the_program_is_missing(system: System, monkeypatch: pytest.MonkeyPatch) -> None:
    def knows_nothing(module: str, symbol: str) -> str:
        raise UnknownSymbol(f"{module} has no {symbol}")

    monkeypatch.setattr(system.world.controller.tasks["T_ROB_L"], "type_of", knows_nothing)
    with refused(RobotNotReady, "state_machine_missing", task="T_ROB_L", module="TRobMain"):
        system.bringup.check_controller()


def test_egm_starts_on_both_arms_with_the_settings_of_the_thesis(system: System) -> None:
    system.start_egm()
    assert [system.bringup.machines.state(side) for side in Side] == [MachineState.RUN_EGM_ROUTINE] * 2
    settings = rapid_values.decode(system.client.symbol("T_ROB_R", EGM_MODULE, "settings"))
    assert isinstance(settings, tuple)
    assert settings[2] == (False, 60.0)
    assert isinstance(settings[3], tuple)
    assert settings[3][4:] == (0.5, 0.0, 4.0, 180.0)


def test_settings_the_robot_has_are_not_written_again(system: System, monkeypatch: pytest.MonkeyPatch) -> None:
    system.start_egm()
    system.bringup.stop_egm()
    monkeypatch.setattr(system.client, "set_symbol", lambda *_: pytest.fail("nothing is to be written"))
    system.start_egm()


def test_bringup_checks_the_controller_once(system: System, monkeypatch: pytest.MonkeyPatch) -> None:
    system.bringup.make_ready()
    monkeypatch.setattr(system.client, "system", lambda: pytest.fail("it is known"))
    system.bringup.make_ready()


def test_egm_ends_when_it_is_stopped(system: System) -> None:
    system.start_egm()
    system.bringup.stop_egm()
    system.wait(0.1)
    assert [system.bringup.machines.state(side) for side in Side] == [MachineState.IDLE, MachineState.IDLE]
    assert not any(arm.snapshot.is_streaming for arm in system.arms.values())


def test_egm_does_not_start_when_the_program_is_stopped(system: System) -> None:
    system.bringup.make_ready()
    system.client.stop_rapid()
    with refused(RobotNotReady, "state_machines_did_not_start_egm", timeout=1.0):
        system.bringup.start_egm()


def test_settings_the_robot_does_not_keep_are_noticed(system: System) -> None:
    motion = replace(EgmMotionSettings(), sample_rate=4)
    bringup = Bringup(system.client, motion, system, system.steps.append)
    bringup.make_ready()
    task = system.world.controller.tasks["T_ROB_L"]
    write = task.write
    task.write = lambda module, symbol, literal: None if symbol == "settings" else write(module, symbol, literal)  # type: ignore[method-assign]
    with refused(RobotNotReady, "egm_settings_not_taken", task="T_ROB_L"):
        bringup.start_egm()


GRIPPER = "[TRUE,[[0,0,114.2],[1,0,0,0]],[0.23,[8.2,11.7,52],[1,0,0,0],0.00021,0.00024,0.00009]]"


def test_tool_and_presync_of_the_settings_reach_the_robot() -> None:
    system = System(motion=EgmMotionSettings(tool=GRIPPER, use_presync=True))
    system.start_egm()
    settings = rapid_values.decode(system.client.symbol("T_ROB_L", EGM_MODULE, "settings"))
    assert isinstance(settings, tuple)
    assert settings[1] is True
    assert isinstance(settings[3], tuple)
    assert settings[3][0] == rapid_values.decode(GRIPPER)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("tool", "tool0"),
        ("tool", "[TRUE]"),
        ("offset", "[[0,0,0],[2,0,0,0]]"),
        ("sensor_frame", '[[0,0,"0"],[1,0,0,0]]'),
    ],
)
def test_settings_that_are_no_rapid_values_are_refused(name: str, text: str) -> None:
    kind = "tooldata" if name == "tool" else "pose"
    with refused(SettingsError, "egm_frame_not_rapid", setting=f"egm_motion: {name}", value=text, type=kind):
        EgmMotionSettings(**{name: text})


def test_user_with_the_grants_the_doctor_asks_for_can_bring_the_robot_up(system: System) -> None:
    system.adapter._users.granted = tuple(NEEDED_GRANTS)
    system.start_egm()


@pytest.mark.parametrize("missing", NEEDED_GRANTS, ids=lambda each: each.name)
def test_robot_cannot_be_brought_up_without_a_grant_the_doctor_asks_for(system: System, missing: Grant) -> None:
    system.adapter._users.granted = [each for each in GRANTS if each is not missing]
    with refused(ControllerRefused, "rws_refused", reason=message("rws_uas_reject")):
        system.start_egm()
