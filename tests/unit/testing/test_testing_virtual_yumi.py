"""The fixture ``virtual_yumi``: a whole robot in memory, which goes on when the test lets time pass."""

from __future__ import annotations

import httpx
import pytest

from abb_protocols.catalogue import message
from abb_protocols.errors import RobotNotReady
from abb_protocols.robot.joints import CYCLE, Side
from abb_protocols.rws.values import ControllerState
from abb_runtime.faults import Fault
from abb_runtime.rws.client import DEFAULT_PASSWORD, DEFAULT_USER
from refusals import refused
from virtual_irc5.mechanics.virtual_gripper import Workpiece
from yumi.egm.joint_codec import JointCodec
from yumi.testing.virtual_yumi import VirtualYumi


def test_time_passes_in_whole_cycles_when_the_test_waits(virtual_yumi: VirtualYumi) -> None:
    assert virtual_yumi.now() == 0.0
    virtual_yumi.wait(10 * CYCLE)
    assert virtual_yumi.now() == pytest.approx(10 * CYCLE)
    virtual_yumi.wait(0.0)
    assert virtual_yumi.now() == pytest.approx(11 * CYCLE)


@pytest.mark.parametrize(("password", "status"), [("wrong", 401), (DEFAULT_PASSWORD, 200)])
def test_any_client_built_on_httpx_reaches_its_web_services(
    virtual_yumi: VirtualYumi, password: str, status: int
) -> None:
    transport, login = httpx.MockTransport(virtual_yumi.rws.handle_request), httpx.DigestAuth(DEFAULT_USER, password)
    with httpx.Client(transport=transport, base_url="http://robot", auth=login) as client:
        state = client.get("/rw/panel/ctrlstate?json=1")
    assert state.status_code == status
    if status == 200:
        assert state.json()["_embedded"]["_state"][0]["ctrlstate"] == "motoroff"


def test_both_arms_speak_egm_once_it_has_started(virtual_yumi: VirtualYumi) -> None:
    assert virtual_yumi.egm[Side.LEFT].receive() == []
    virtual_yumi.start_egm()
    virtual_yumi.wait(CYCLE)
    for side in Side:
        newest = JointCodec().decode(virtual_yumi.egm[side].receive()[-1])
        assert newest.measured == pytest.approx(virtual_yumi.world.arms[side].position, abs=1e-4)


def test_fault_is_injected_and_keeps_egm_from_starting(virtual_yumi: VirtualYumi) -> None:
    virtual_yumi.faults.inject(Fault.EMERGENCY_STOP)
    with virtual_yumi.client() as client:
        assert client.controller_state() is ControllerState.EMERGENCY_STOP
    with refused(RobotNotReady, "cannot_bring_up", reason=message("emergency_stop_pressed")):
        virtual_yumi.start_egm()


@pytest.mark.virtual_yumi(workpieces={Side.LEFT: Workpiece(0.02)}, grippers_are_calibrated=True)
def test_mark_chooses_what_the_robot_is_like(virtual_yumi: VirtualYumi) -> None:
    assert virtual_yumi.world.grippers[Side.LEFT].workpiece == Workpiece(0.02)
    assert virtual_yumi.world.grippers[Side.RIGHT].is_calibrated
