from __future__ import annotations

from typing import get_args

import pytest

from unit.control.controller_doubles import RUNNING, Double
from yumi.control.commands import MemoryMailbox
from yumi.control.controller import State
from yumi.control.controller_manager import ControllerManager
from yumi.control.limiter import Limiter
from yumi.control.loop import ArmLine, RequestDesk
from yumi.control.requests import (
    ArmRequest,
    CheckOrders,
    CleanupController,
    ConfigureController,
    ControllerNotice,
    Done,
    HoldArm,
    ListControllerKinds,
    ListControllers,
    ListHardware,
    ListParameters,
    LoadController,
    Order,
    Refusal,
    Request,
    SendOrders,
    SetHardwareState,
    SetParameters,
    Strictness,
    SwitchControllers,
    UnloadController,
)
from yumi.control.shared_state import Snapshot, peek_snapshot
from yumi.driver.arm import PerfectArm
from yumi.robot.joints import YUMI_LIMITS, ZERO, Side, joint_names

LEFT, RIGHT = Side.LEFT, Side.RIGHT


class Arms:
    """Both arms, each with a double named ``double`` that is active."""

    def __init__(self) -> None:
        self.doubles = {side: Double() for side in Side}
        self.boxes = {side: MemoryMailbox() for side in Side}
        self.lines = {side: self._line(side) for side in Side}
        self.desk = RequestDesk(self.lines)

    def _line(self, side: Side) -> ArmLine:
        manager = ControllerManager(joint_names(side), {"test/Double": lambda name: Double("velocity")}, side.unit)
        manager.load("double", self.doubles[side])
        manager.configure("double")
        manager.switch(["double"], [], RUNNING)
        return ArmLine(side, PerfectArm(ZERO), manager, Limiter(YUMI_LIMITS), self.boxes[side])

    def ask(self, request: Request) -> Done:
        reply = self.desk.serve(request, 5.0)
        assert isinstance(reply, Done), reply.sentence
        return reply

    def refusal(self, request: Request) -> str:
        reply = self.desk.serve(request, 5.0)
        assert isinstance(reply, Refusal)
        return reply.sentence

    def snapshot(self, side: Side) -> Snapshot:
        return peek_snapshot(self.boxes[side])

    def state(self, side: Side, name: str) -> State:
        return next(info.state for info in self.ask(ListControllers(side)).controllers if info.name == name)


@pytest.fixture
def arms() -> Arms:
    return Arms()


def test_desk_serves_every_request_there_is(arms: Arms) -> None:
    for kind in get_args(ArmRequest):
        rest = {"name": "nobody", "kind": "nothing", "controller": "nobody", "state": State.ACTIVE}
        names = [name for name in kind.__dataclass_fields__ if name in rest]
        reply = arms.desk.serve(kind(RIGHT, **{name: rest[name] for name in names}), 5.0)
        assert isinstance(reply, Done) or "failed with" not in reply.sentence


def test_desk_leads_a_controller_through_its_life(arms: Arms) -> None:
    assert arms.ask(ListControllerKinds(LEFT)).kinds == ("test/Double",)
    arms.ask(LoadController(LEFT, "other", "test/Double", {"p": 0.5}))
    assert arms.state(LEFT, "other") is State.UNCONFIGURED
    arms.ask(ConfigureController(LEFT, "other"))
    assert arms.state(LEFT, "other") is State.INACTIVE
    arms.ask(CleanupController(LEFT, "other"))
    assert arms.state(LEFT, "other") is State.UNCONFIGURED
    arms.ask(UnloadController(LEFT, "other"))
    assert [info.name for info in arms.ask(ListControllers(LEFT)).controllers] == ["double"]


def test_desk_switches_by_the_strictness_asked_for(arms: Arms) -> None:
    lenient = SwitchControllers(LEFT, ("nobody",), ("double",), Strictness.BEST_EFFORT)
    assert "There is no controller 'nobody'" in arms.ask(lenient).sentence
    assert arms.state(LEFT, "double") is State.INACTIVE
    assert "There is no controller 'nobody'" in arms.refusal(SwitchControllers(LEFT, ("nobody",)))


def test_desk_has_an_arm_hold_whoever_commands_it(arms: Arms) -> None:
    arms.ask(HoldArm(LEFT))
    assert [arms.state(side, "double") for side in (LEFT, RIGHT)] == [State.INACTIVE, State.ACTIVE]
    arms.ask(HoldArm(LEFT))


def test_desk_sets_and_lists_parameters(arms: Arms) -> None:
    arms.ask(SetParameters(RIGHT, "double", {"p": 0.25}))
    infos = arms.ask(ListParameters(RIGHT, "double")).parameters
    assert [(info.parameter.name, info.value) for info in infos] == [("p", 0.25), ("mode", "slow")]


def test_desk_leads_the_hardware(arms: Arms) -> None:
    (info,) = arms.ask(SetHardwareState(RIGHT, "ROB_R", State.INACTIVE)).hardware
    assert arms.ask(ListHardware(RIGHT)).hardware == (info,)
    assert (info.state, arms.state(RIGHT, "double")) == (State.INACTIVE, State.INACTIVE)


@pytest.mark.parametrize(
    "request_",
    [
        LoadController(LEFT, "other", "test/Double"),
        ConfigureController(LEFT, "spare"),
        CleanupController(LEFT, "spare"),
        UnloadController(LEFT, "spare"),
        SwitchControllers(LEFT, deactivate=("double",)),
        HoldArm(LEFT),
        SetHardwareState(LEFT, "ROB_L", State.INACTIVE),
    ],
    ids=lambda request: type(request).__name__,
)
def test_desk_shows_a_change_in_the_snapshot_at_once(arms: Arms, request_: Request) -> None:
    arms.ask(LoadController(LEFT, "spare", "test/Double"))
    before = arms.snapshot(LEFT).activity
    arms.ask(request_)
    assert (arms.snapshot(LEFT).activity > before, arms.snapshot(LEFT).time) == (True, 5.0)


def test_desk_refuses_what_a_rule_stands_against(arms: Arms) -> None:
    sentence = arms.refusal(LoadController(RIGHT, "double", "test/Double"))
    assert sentence == "Controller 'double' is loaded already; unload it first or choose another name."


def test_desk_refuses_a_request_that_fails(arms: Arms) -> None:
    arms.lines[LEFT].manager.controllers = lambda: 1 / 0  # type: ignore[assignment,return-value,method-assign]
    assert "failed with ZeroDivisionError: division by zero." in arms.refusal(ListControllers(LEFT))


def test_desk_sends_orders_to_both_arms(arms: Arms) -> None:
    arms.ask(SendOrders((Order(LEFT, "double", "go left"), Order(RIGHT, "double", "go right"))))
    assert [arms.doubles[side].orders for side in (LEFT, RIGHT)] == [["go left"], ["go right"]]


@pytest.mark.parametrize(
    ("second", "sentence"),
    [
        (Order(RIGHT, "double", "bad"), "The order is bad; send a good one."),
        (Order(RIGHT, "nobody", "good"), "There is no controller 'nobody'; loaded are: double."),
        (Order(LEFT, "double", "good"), "Controller 'double' of l is sent 2 orders at once; send one."),
    ],
)
def test_desk_sends_no_order_when_one_is_refused(arms: Arms, second: Order, sentence: str) -> None:
    assert arms.refusal(SendOrders((Order(LEFT, "double", "good"), second))) == sentence
    assert arms.refusal(CheckOrders((Order(LEFT, "double", "good"), second))) == sentence
    assert [double.orders for double in arms.doubles.values()] == [[], []]


def test_desk_checks_orders_without_sending_them(arms: Arms) -> None:
    arms.ask(CheckOrders((Order(LEFT, "double", "good"),)))
    assert arms.doubles[LEFT].orders == []


def test_line_passes_notices_on(arms: Arms) -> None:
    arms.doubles[LEFT].notices = ["arrived"]
    (event,) = arms.lines[LEFT].take_events()
    assert event == ControllerNotice(LEFT, "double", "arrived")
    assert str(event) == "Left arm: double: arrived"
