"""What the driver checks before it uses a controller, against the virtual one."""

from __future__ import annotations

from dataclasses import replace

import pytest

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import ControllerRefused, RobotNotReady
from abb_protocols.robot.joints import Joints, Side
from abb_protocols.rws.operations.configuration import CfgInstance
from abb_runtime.faults import Fault
from refusals import assert_says, refused
from system.virtual_time_bench import System
from yumi.driver.launch_checks import EgmAddress, LaunchChecks

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
    with refused(RobotNotReady, "unit_missing", unit="ROB_R", arm="right"):
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
    robot_here = f"{robot} (mechanical unit ROB_1), not a YuMi"
    with refused(RobotNotReady, "not_a_yumi", address="memory", robot=robot_here) as refusal:
        remarks(system, HERE)
    assert (refusal.value.__cause__, refusal.value.__context__) == (None, None)


def test_program_of_another_version_is_refused(system: System, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(system.client, "symbol", lambda *_: "1")
    with refused(RobotNotReady, "state_machine_of_other_version", task="T_ROB_R", version="1.0", expected=1.1):
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
    elsewhere = message(
        "datagrams_go_elsewhere", arm="left", there="127.0.0.1:6511", here="127.0.0.1:7000", device="ROB_L"
    )
    with refused(RobotNotReady, "no_datagram_came_misdirected", why=(elsewhere,)):
        system.manager.start_egm()


def test_arm_without_a_device_is_refused(system: System, monkeypatch: pytest.MonkeyPatch) -> None:
    serial = CfgInstance("ROB_L", {"Type": "SIO"})
    monkeypatch.setattr(system.client, "cfg", lambda *_: (serial,))
    with refused(RobotNotReady, "udpuc_device_missing", device="ROB_L"):
        remarks(system, HERE)


def test_remarks_are_reported_once_with_the_next_steps(system: System) -> None:
    without(system, "SmartGripper")
    for _ in range(2):
        system.bringup.check_controller(HERE)
        system.bringup.make_ready()
    told = [step for step in system.steps if "SmartGripper" in step]
    assert told == [str(message("grippers_missing", product="SmartGripper"))]
