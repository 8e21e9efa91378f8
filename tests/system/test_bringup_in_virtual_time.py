"""Bring-up and EGM against the virtual controller: real RAPID, real RWS documents, virtual time."""

from __future__ import annotations

from dataclasses import replace

import pytest

from system.virtual_time_bench import System
from yumi.errors import RobotNotReady, SettingsError
from yumi.hardware.bringup import Bringup
from yumi.hardware.state_machine import EGM, EgmMotionSettings, MachineState
from yumi.rapid.errors import UnknownSymbol
from yumi.robot.joints import Side
from yumi.rws import rapid_values
from yumi.rws.states import ControllerState, ExecutionState, OperatingMode


@pytest.fixture
def system() -> System:
    return System()


def test_bringup_switches_on_starts_and_waits_for_idle(system: System) -> None:
    system.bringup.make_ready()
    assert system.steps == ["motors on", "program pointer to main", "start the RAPID program"]
    assert system.client.controller_state() is ControllerState.MOTORS_ON
    assert system.client.execution() is ExecutionState.RUNNING
    assert [system.bringup.state(side) for side in Side] == [MachineState.IDLE, MachineState.IDLE]


def test_bringup_does_nothing_to_a_robot_that_is_ready(system: System) -> None:
    system.bringup.make_ready()
    system.steps.clear()
    system.bringup.make_ready()
    assert system.steps == []


def test_bringup_says_why_the_robot_is_not_ready(system: System) -> None:
    assert system.manager.state().reason == "the motors are off"
    system.client.set_motors(True)
    system.wait(1.0)
    assert system.manager.state().reason == "the RAPID program is stopped"
    system.bringup.make_ready()
    assert system.manager.state().reason == ""


def test_bringup_says_that_only_the_pendant_chooses_auto(system: System) -> None:
    system.world.controller.mode = OperatingMode.MANUAL_REDUCED
    with pytest.raises(RobotNotReady, match="The controller is in MANR; turn it to AUTO on the pendant"):
        system.bringup.make_ready()
    assert system.manager.state().reason == "the controller is not in AUTO"


def test_bringup_refuses_a_controller_without_egm(system: System) -> None:
    controller = system.world.controller
    options = tuple(option for option in controller.identity.options if not option.startswith("689-1"))
    controller.identity = replace(controller.identity, options=options)
    with pytest.raises(RobotNotReady, match=r"lacks the option '689-1 Externally Guided Motion \(EGM\)'"):
        system.bringup.check_controller()


def test_bringup_refuses_a_robotware_that_is_too_old(system: System) -> None:
    controller = system.world.controller
    controller.identity = replace(controller.identity, robotware="6.08.01.00")
    with pytest.raises(RobotNotReady, match=r"runs RobotWare 6\.8\.1\.0; EGM for a YuMi needs 6\.09 or newer"):
        system.bringup.check_controller()


def test_bringup_says_that_the_program_is_missing(system: System, monkeypatch: pytest.MonkeyPatch) -> None:
    def knows_nothing(module: str, symbol: str) -> str:
        raise UnknownSymbol(f"{module} has no {symbol}")

    monkeypatch.setattr(system.world.controller.tasks["T_ROB_L"], "type_of", knows_nothing)
    with pytest.raises(RobotNotReady, match=r"Task T_ROB_L has no state machine \(TRobMain\)"):
        system.bringup.check_controller()


def test_egm_starts_on_both_arms_with_the_settings_of_the_thesis(system: System) -> None:
    system.start_egm()
    assert [system.bringup.state(side) for side in Side] == [MachineState.RUN_EGM_ROUTINE] * 2
    settings = rapid_values.decode(system.client.symbol("T_ROB_R", EGM, "settings"))
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
    assert [system.bringup.state(side) for side in Side] == [MachineState.IDLE, MachineState.IDLE]
    assert not any(arm.snapshot.is_streaming for arm in system.arms.values())


def test_egm_does_not_start_when_the_program_is_stopped(system: System) -> None:
    system.bringup.make_ready()
    system.client.stop_rapid()
    with pytest.raises(RobotNotReady, match="The state machines did not reach RUN_EGM_ROUTINE within 1 s"):
        system.bringup.start_egm()


def test_settings_the_robot_does_not_keep_are_noticed(system: System) -> None:
    motion = replace(EgmMotionSettings(), sample_rate=4)
    bringup = Bringup(system.client, motion, system, system.steps.append)
    bringup.make_ready()
    task = system.world.controller.tasks["T_ROB_L"]
    write = task.write
    task.write = lambda module, symbol, literal: None if symbol == "settings" else write(module, symbol, literal)  # type: ignore[method-assign]
    with pytest.raises(RobotNotReady, match="T_ROB_L did not take the EGM settings"):
        bringup.start_egm()


GRIPPER = "[TRUE,[[0,0,114.2],[1,0,0,0]],[0.23,[8.2,11.7,52],[1,0,0,0],0.00021,0.00024,0.00009]]"


def test_tool_and_presync_of_the_settings_reach_the_robot() -> None:
    system = System(motion=EgmMotionSettings(tool=GRIPPER, use_presync=True))
    system.start_egm()
    settings = rapid_values.decode(system.client.symbol("T_ROB_L", EGM, "settings"))
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
    with pytest.raises(SettingsError, match=f"egm_motion: {name} is .*; it must be a RAPID (tooldata|pose) such as"):
        EgmMotionSettings(**{name: text})
