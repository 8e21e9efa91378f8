"""Faults given to a virtual controller that runs: what they do, and which are refused."""

from __future__ import annotations

import json
from contextlib import suppress

import httpx
import pytest

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import Side
from abb_protocols.rws.values import CollisionState, ControllerState, OperatingMode
from abb_runtime.clock import ManualClock
from abb_runtime.faults import FAULTS_PATH, Fault, FaultDirection, inject_fault
from memory_http import MemoryHttp
from system.virtual_time_bench import System
from virtual_irc5.fault_injection import FaultInjection
from virtual_irc5.mechanics.egm_client import EgmOutcome
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.world import World

LOCAL = "127.0.0.1:4711"


@pytest.fixture
def system() -> System:
    return System()


@pytest.fixture
def egm_system() -> System:
    """Both arms under EGM."""
    system = System()
    system.start_egm()
    return system


@pytest.fixture
def faults(system: System) -> FaultInjection:
    return system.faults


@pytest.fixture
def egm_faults(egm_system: System) -> FaultInjection:
    return egm_system.faults


@pytest.fixture(scope="module")
def idle_faults() -> FaultInjection:
    """Of a robot that stands with its motors off; shared by tests that change nothing."""
    return System().faults


@pytest.fixture(scope="module")
def used_faults() -> FaultInjection:
    """Of a robot that has been through a lot."""
    world = World()
    return FaultInjection(world, MemoryHttp(world.controller, ManualClock()).adapter)


HOST = (("Host", "127.0.0.1:8080"),)


def post(
    faults: FaultInjection,
    name: str,
    form: str = "",
    peer: str = LOCAL,
    method: str = "POST",
    headers: tuple[tuple[str, str], ...] = HOST,
) -> HttpReply:
    return faults.answer(HttpRequest(method, f"{FAULTS_PATH}/{name}".rstrip("/"), headers, form.encode(), peer))


@pytest.mark.parametrize("duration", [0.05, 1.0])
def test_silence_lasts_for_its_duration(egm_system: System, egm_faults: FaultInjection, duration: float) -> None:
    egm_faults.inject(Fault.EGM_SILENCE, Side.LEFT, duration)
    heard = {side: egm_system.arms[side].snapshot.cycles for side in Side}
    egm_system.wait(duration - 0.01)
    assert egm_system.arms[Side.LEFT].snapshot.cycles == heard[Side.LEFT]
    assert egm_system.arms[Side.RIGHT].snapshot.cycles > heard[Side.RIGHT]
    egm_system.wait(0.02)
    assert egm_system.arms[Side.LEFT].snapshot.cycles > heard[Side.LEFT]


def test_silence_without_a_duration_lasts_until_the_repair(egm_system: System, egm_faults: FaultInjection) -> None:
    egm_faults.inject(Fault.EGM_SILENCE)
    egm_system.wait(1.0)
    assert all(egm_system.world.network.amount(Fault.EGM_LOSS, side) == 100.0 for side in Side)
    egm_faults.inject(Fault.EGM_REPAIR)
    assert all(egm_system.world.network.amount(Fault.EGM_LOSS, side) is None for side in Side)


@pytest.mark.parametrize(
    ("fault", "state", "code"),
    [
        (Fault.DYNAMIC_LOAD, ControllerState.MOTORS_OFF, 50375),
        (Fault.COLLISION, ControllerState.MOTORS_ON, 50204),
        (Fault.EMERGENCY_STOP, ControllerState.EMERGENCY_STOP, 10013),
        (Fault.MOTORS_OFF, ControllerState.MOTORS_OFF, 10010),
        (Fault.PROGRAM_STOP, ControllerState.MOTORS_ON, 10125),
        (Fault.MANUAL_MODE, ControllerState.MOTORS_OFF, 10015),
    ],
)
def test_fault_stops_the_program_and_is_logged(
    egm_system: System, egm_faults: FaultInjection, fault: Fault, state: ControllerState, code: int
) -> None:
    egm_faults.inject(fault)
    egm_system.wait(0.1)
    controller = egm_system.world.controller
    assert (controller.controller_state, controller.is_running) == (state, False)
    assert code in [event.code for event in controller.events.entries()]
    assert not any(egm.is_running for egm in egm_system.world.egm.values())


def test_robot_without_datagrams_ends_egm_by_its_timeout(egm_system: System, egm_faults: FaultInjection) -> None:
    egm_faults.inject(Fault.COMM_TIMEOUT, Side.LEFT)
    egm_system.wait(0.1)
    egm = egm_system.world.egm[Side.LEFT]
    assert (egm.is_running, egm.outcome) == (False, EgmOutcome.COMM_TIMEOUT)
    assert egm_system.client.symbol("T_ROB_L", "TRobMain", "current_state") == "0"


def test_converged_egm_ends_for_the_arm_alone(egm_system: System, egm_faults: FaultInjection) -> None:
    egm_faults.inject(Fault.EGM_CONVERGENCE, Side.LEFT)
    egm_system.wait(0.05)
    assert not egm_system.world.egm[Side.LEFT].is_running
    assert egm_system.world.egm[Side.RIGHT].is_running
    assert egm_system.world.controller.controller_state is ControllerState.MOTORS_ON


def test_collision_is_acknowledged_by_the_next_start(egm_system: System, egm_faults: FaultInjection) -> None:
    egm_faults.inject(Fault.COLLISION, Side.RIGHT)
    egm_system.wait(0.1)
    assert egm_system.world.controller.collision_state is CollisionState.TRIGGERED
    egm_system.client.start_rapid()
    assert egm_system.world.controller.collision_state is CollisionState.INIT


def test_key_is_turned_to_manual_and_back(system: System, faults: FaultInjection) -> None:
    faults.inject(Fault.MANUAL_MODE)
    assert system.world.controller.mode is OperatingMode.MANUAL_REDUCED
    faults.inject(Fault.AUTO_MODE)
    assert system.world.controller.mode is OperatingMode.AUTO


def test_wrong_program_takes_the_place_of_the_right_one_and_goes_again(
    egm_system: System, egm_faults: FaultInjection
) -> None:
    egm_faults.inject(Fault.WRONG_PROGRAM)
    assert [module.name for module in egm_system.client.modules("T_ROB_L")] == ["user", "Pick"]
    egm_system.client.start_rapid()
    egm_system.wait(2.0)
    assert egm_system.world.controller.is_running
    egm_faults.inject(Fault.RIGHT_PROGRAM)
    egm_system.bringup.make_ready()


def test_restarting_robot_does_not_answer_and_runs_egm_afterwards(
    egm_system: System, egm_faults: FaultInjection
) -> None:
    egm_faults.inject(Fault.WARM_RESTART, duration=1.0)
    egm_system.wait(0.5)
    heard = egm_system.arms[Side.LEFT].snapshot.cycles
    egm_system.wait(0.6)
    assert (egm_system.world.controller.is_restarting, egm_system.arms[Side.LEFT].snapshot.cycles) == (True, heard)
    egm_system.wait(0.2)
    egm_system.start_egm()
    assert all(arm.snapshot.is_running for arm in egm_system.arms.values())


def test_gripper_loses_calibration_and_object(system: System, faults: FaultInjection) -> None:
    gripper = system.world.grippers[Side.LEFT]
    gripper.is_calibrated = True
    faults.inject(Fault.GRIPPER_NOT_CALIBRATED, Side.LEFT)
    faults.inject(Fault.OBJECT_LOST)
    assert (gripper.is_calibrated, gripper.workpiece) == (False, None)


@pytest.mark.parametrize(
    ("fault", "side", "duration", "sentence"),
    [
        (Fault.COMM_TIMEOUT, Side.LEFT, None, "EGM does not move the left arm; start EGM first."),
        (Fault.DYNAMIC_LOAD, None, None, "EGM does not move the right arm; start EGM first."),
        (Fault.COLLISION, None, None, "An arm whose motors are off does not collide; switch the motors on first."),
        (Fault.OBJECT_LOST, Side.RIGHT, None, "Nothing lies between the fingers or under the cups of the right arm."),
        (Fault.MOTORS_OFF, Side.LEFT, None, "motors-off happens to the whole robot; leave the side out."),
        (Fault.MOTORS_OFF, None, 1.0, "motors-off has no duration; leave it out."),
        (Fault.EGM_SILENCE, None, -1.0, "A duration is above 0 and at most 86400 s, not -1 s."),
        (Fault.EGM_STALE, Side.LEFT, None, "EGM does not move the left arm; start EGM first."),
        (Fault.EGM_FORGE, None, None, "EGM does not move the right arm; start EGM first."),
        (Fault.EMERGENCY_STOP_RESET, None, None, "The emergency stop is not pressed; there is nothing to reset."),
        (Fault.AUTO_MODE, None, None, "The key stands at AUTO already."),
        (Fault.MOTORS_OFF, None, None, "The motors are off already."),
        (Fault.PROGRAM_STOP, None, None, "No RAPID program runs; there is nothing to stop."),
    ],
)
def test_fault_that_makes_no_sense_is_refused(
    idle_faults: FaultInjection, fault: Fault, side: Side | None, duration: float | None, sentence: str
) -> None:
    with pytest.raises(CommandRefused) as refused:
        idle_faults.inject(fault, side, duration)
    assert str(refused.value) == sentence


@pytest.mark.parametrize(
    ("fault", "amount", "way", "sentence"),
    [
        (Fault.EGM_LOSS, 101.0, None, "The strength ('by') of egm-loss is 0 to 100 %, not 101."),
        (
            Fault.EGM_STALE,
            2.5,
            None,
            "The strength ('by') of egm-stale is a whole number from 1 to 999 datagrams, not 2.5.",
        ),
        (Fault.EGM_SWAP_ARMS, 1.0, None, "egm-swap-arms has no strength; leave 'by' out."),
        (Fault.EGM_STALE, None, FaultDirection.TO_ROBOT, "egm-stale has no direction; leave 'way' out."),
    ],
)
def test_strength_that_makes_no_sense_is_refused(
    idle_faults: FaultInjection, fault: Fault, amount: float | None, way: FaultDirection | None, sentence: str
) -> None:
    with pytest.raises(CommandRefused) as refused:
        idle_faults.inject(fault, amount=amount, way=way)
    assert str(refused.value) == sentence


def test_stop_that_is_pressed_is_not_pressed_again_but_reset_once(system: System, faults: FaultInjection) -> None:
    faults.inject(Fault.EMERGENCY_STOP)
    with pytest.raises(CommandRefused, match="The emergency stop is pressed already; emergency-stop-reset releases it"):
        faults.inject(Fault.EMERGENCY_STOP)
    faults.inject(Fault.EMERGENCY_STOP_RESET)
    assert system.world.controller.controller_state is ControllerState.EMERGENCY_STOP_RESET
    with pytest.raises(CommandRefused, match="not pressed"):
        faults.inject(Fault.EMERGENCY_STOP_RESET)


def test_datagram_that_was_never_sent_cannot_come_again(egm_system: System, egm_faults: FaultInjection) -> None:
    with pytest.raises(
        CommandRefused, match=r"The left arm has sent only \d+ EGM datagrams, not 999; let it send more"
    ):
        egm_faults.inject(Fault.EGM_STALE, Side.LEFT, amount=999.0)


def test_faults_are_listed(idle_faults: FaultInjection) -> None:
    names = [entry["name"] for entry in json.loads(post(idle_faults, "", method="GET").body)]
    assert names == [fault.value.name for fault in Fault]


def test_fault_is_posted(system: System, faults: FaultInjection) -> None:
    assert post(faults, "emergency-stop").status == 204
    assert post(faults, "egm-loss", "side=left&duration=2&by=100&way=from-robot").status == 204
    assert system.world.controller.controller_state is ControllerState.EMERGENCY_STOP
    assert system.world.network.amount(Fault.EGM_LOSS, Side.LEFT, FaultDirection.FROM_ROBOT) == 100.0
    assert system.world.network.amount(Fault.EGM_LOSS, Side.LEFT, FaultDirection.TO_ROBOT) is None


@pytest.mark.parametrize(
    ("name", "form", "peer", "status", "sentence"),
    [
        ("emergency-stop", "", "192.168.125.7:99", 403, "Faults are taken from programs on this machine only."),
        ("emergency-stop", "", "", 403, "Faults are taken from programs on this machine only."),
        ("earthquake", "", LOCAL, 404, "There is no fault 'earthquake' to POST; POST one of egm-silence, egm-repair"),
        ("egm-silence", "side=middle", LOCAL, 409, "A side is left or right, not 'middle'."),
        ("egm-silence", "duration=nan", LOCAL, 409, "A duration is a number of seconds, not 'nan'."),
        ("egm-silence", "duration=long", LOCAL, 409, "A duration is a number of seconds, not 'long'."),
        ("egm-loss", "by=half", LOCAL, 409, "'by' is a number, not 'half'."),
        ("egm-loss", "way=back", LOCAL, 409, "The direction ('way') is to-robot, from-robot or both, not 'back'."),
    ],
)
def test_posted_nonsense_is_refused(
    idle_faults: FaultInjection, name: str, form: str, peer: str, status: int, sentence: str
) -> None:
    reply = post(idle_faults, name, form, peer)
    assert (reply.status, reply.body.decode().startswith(sentence)) == (status, True)


@pytest.mark.parametrize("method", ["GET", "POST"])
@pytest.mark.parametrize(
    "headers",
    [
        (("Host", "evil.example"),),
        (("Host", "evil.example:8080"), ("Origin", "http://evil.example:8080")),
        (("Host", "127.0.0.1.evil.example"),),
        (*HOST, ("Origin", "http://evil.example")),
        (*HOST, ("Origin", "null")),
        (*HOST, ("Origin", "")),
        (*HOST, ("Origin", "http://[::1")),
        (("Host", "[evil"),),
        (),
    ],
)
def test_web_page_cannot_inject_a_fault(
    idle_faults: FaultInjection, method: str, headers: tuple[tuple[str, str], ...]
) -> None:
    """Neither by a form of its own, nor under a name of its own that leads to this machine."""
    reply = post(idle_faults, "emergency-stop", method=method, headers=headers)
    assert (reply.status, reply.body.decode().split(",")[0]) == (
        403,
        "Faults are taken under the names of this machine only",
    )


@pytest.mark.parametrize(
    "headers",
    [
        (("Host", "localhost:8080"),),
        (("Host", "[::1]:8080"),),
        (("host", "127.0.0.1"),),
        (*HOST, ("Origin", "http://localhost:8080")),
    ],
)
def test_program_of_this_machine_injects_faults(
    idle_faults: FaultInjection, headers: tuple[tuple[str, str], ...]
) -> None:
    assert post(idle_faults, "egm-repair", headers=headers).status == 204


@pytest.mark.parametrize("fault", Fault)
def test_every_fault_can_be_injected(used_faults: FaultInjection, fault: Fault) -> None:
    with suppress(CommandRefused):
        used_faults.inject(fault)


@pytest.mark.parametrize(
    "name",
    [
        "../../rw/panel/ctrlstate?action=setctrlstate",
        "..",
        "",
        "emergency-stop/..",
        "motors-off?",
        "%2e%2e",
        "MOTORS-OFF",
    ],
)
def test_name_that_no_fault_has_is_never_sent(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[str] = []

    def answer(method: str, url: str, **options: object) -> httpx.Response:
        sent.append(url)
        return httpx.Response(204)

    monkeypatch.setattr(httpx, "request", answer)
    with pytest.raises(CommandRefused) as refusal:
        inject_fault("127.0.0.1:80", name, {})
    assert str(refusal.value) == f"There is no fault {name!r}; `virtual-irc5 fault` lists all faults."
    assert sent == []
    assert inject_fault("127.0.0.1:80", "motors-off", {}) is Fault.MOTORS_OFF
    assert sent == [f"http://127.0.0.1:80{FAULTS_PATH}/motors-off"]
