"""What the driver checks before it uses a controller, against the virtual one."""

from __future__ import annotations

from dataclasses import replace

import pytest

from refusals import assert_says
from system.virtual_time_bench import System
from yumi.catalogue import Message, message
from yumi.driver.bringup import EgmAddress, LaunchChecks
from yumi.errors import ControllerRefused, RobotNotReady
from yumi.robot.joints import Joints, Side
from yumi.rws.documents import CfgInstance
from yumi.virtual.faults import Fault

HERE = {Side.LEFT: EgmAddress("127.0.0.1", 6511), Side.RIGHT: EgmAddress("127.0.0.1", 6512)}


@pytest.fixture
def system() -> System:
    return System()


def without(system: System, start: str) -> None:
    controller = system.world.controller
    options = tuple(option for option in controller.identity.options if not option.startswith(start))
    controller.identity = replace(controller.identity, options=options)


def remarks(system: System, addresses: dict[Side, EgmAddress]) -> list[Message]:
    checks = LaunchChecks(system.client, addresses)
    checks.run()
    return checks.remarks


def test_controller_that_has_everything_passes_without_remarks(system: System) -> None:
    assert remarks(system, HERE) == []


@pytest.mark.parametrize("option", ["623-1", "616-1"])
def test_controller_without_an_option_that_is_not_needed_is_used(system: System, option: str) -> None:
    without(system, option)
    assert remarks(system, HERE) == []


def test_controller_without_grippers_is_used_with_a_remark(system: System) -> None:
    without(system, "SmartGripper")
    assert remarks(system, HERE) == [message("grippers_missing", product="SmartGripper")]


def test_controller_without_an_arm_is_refused(system: System, monkeypatch: pytest.MonkeyPatch) -> None:
    def joint_target(unit: str) -> Joints:
        raise ControllerRefused(f"there is no {unit}", status=400)

    monkeypatch.setattr(system.client, "joint_target", joint_target)
    with pytest.raises(RobotNotReady, match="no mechanical unit ROB_R; it does not move a YuMi's right arm"):
        remarks(system, HERE)


@pytest.mark.parametrize(
    ("options", "robot"),
    [(("IRB 120-3/0.6",), "an IRB 120"), (("IRB 6700-155/2.85",), "an IRB 6700"), ((), "another robot")],
)
def test_another_robot_is_refused_by_its_name_before_anything_that_it_lacks(
    system: System, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], robot: str
) -> None:
    controller = system.world.controller
    controller.identity = replace(controller.identity, options=options)
    monkeypatch.setattr(system.client, "mechanical_units", lambda: ("ROB_1",))
    with pytest.raises(RobotNotReady) as refused:
        remarks(system, HERE)
    assert str(refused.value) == (
        f"The controller at memory is {robot} (mechanical unit ROB_1), not a YuMi; for other robots use "
        "yumi.EgmServer (docs/how-to/control-any-abb-robot.md), or look with `yumi view --robot memory`."
    )
    assert (refused.value.__cause__, refused.value.__context__) == (None, None)


def test_program_of_another_version_is_refused(system: System, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(system.client, "symbol", lambda *_: "1")
    with pytest.raises(RobotNotReady, match=r"Task T_ROB_R has version 1\.0 of the state machine, not 1\.1; load"):
        remarks(system, HERE)


def test_datagrams_that_go_elsewhere_are_reported(system: System) -> None:
    elsewhere = {Side.LEFT: EgmAddress("192.168.125.50", 6511), Side.RIGHT: EgmAddress("0.0.0.0", 7000)}
    for remark, arm, there, here in zip(
        remarks(system, elsewhere),
        ("left", "right"),
        ("127.0.0.1:6511", "127.0.0.1:6512"),
        ("192.168.125.50:6511", "0.0.0.0:7000"),
        strict=True,
    ):
        assert_says(remark, "datagrams_go_elsewhere", arm=arm, there=there, here=here)


def test_egm_without_datagrams_names_the_port_that_they_go_to(system: System) -> None:
    system.bringup.check_controller({**HERE, Side.LEFT: EgmAddress("127.0.0.1", 7000)})
    system.faults.inject(Fault.EGM_SILENCE)
    with pytest.raises(RobotNotReady) as error:
        system.manager.start_egm()
    assert str(error.value) == (
        "EGM started on the robot but no datagram came: the left arm's datagrams go to 127.0.0.1:6511, here they are "
        "awaited at 127.0.0.1:7000; make the UDPUC device ROB_L or the settings fit."
    )


def test_arm_without_a_device_is_refused(system: System, monkeypatch: pytest.MonkeyPatch) -> None:
    serial = CfgInstance("ROB_L", {"Type": "SIO"})
    monkeypatch.setattr(system.client, "cfg", lambda *_: (serial,))
    with pytest.raises(RobotNotReady, match=r"The controller has no UDPUC device ROB_L .*; load SIO\.cfg of this"):
        remarks(system, HERE)


def test_remarks_are_reported_once_with_the_next_steps(system: System) -> None:
    without(system, "SmartGripper")
    for _ in range(2):
        system.bringup.check_controller(HERE)
        system.bringup.make_ready()
    told = [step for step in system.steps if "SmartGripper" in step]
    assert told == [str(message("grippers_missing", product="SmartGripper"))]
