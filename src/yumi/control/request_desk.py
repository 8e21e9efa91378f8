"""Carries out what is asked of a fast line, between two cycles."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

from yumi.control.arm_line import ArmLine
from yumi.control.requests import (
    CheckOrders,
    CleanupController,
    ConfigureController,
    Done,
    HoldArm,
    ListControllerKinds,
    ListControllers,
    ListHardware,
    ListParameters,
    LoadController,
    Order,
    Refusal,
    Reply,
    Request,
    SendOrders,
    SetHardwareState,
    SetParameters,
    SwitchControllers,
    UnloadController,
)
from yumi.errors import CommandRefused, SwitchFailed
from yumi.robot.joints import Side

Serve = Callable[[ArmLine, Any, float], Done]


class RequestDesk:
    """Serves requests one after the other; the arms' cycles have to rest meanwhile.

    Args:
        lines: the arms of this process.
    """

    def __init__(self, lines: Mapping[Side, ArmLine]) -> None:
        self._lines = lines

    def serve(self, request: Request, now: float) -> Reply:
        """Carry out ``request``; whatever stands against it becomes a refusal."""
        try:
            return self._carry_out(request, now)
        except (CommandRefused, SwitchFailed) as error:
            return Refusal(str(error))
        except Exception as error:
            return Refusal(f"The request {request} failed with {type(error).__name__}: {error}.")

    def _carry_out(self, request: Request, now: float) -> Done:
        if isinstance(request, CheckOrders):
            return self._check_orders(request.orders)
        if isinstance(request, SendOrders):
            return self._send_orders(request.orders)
        return _SERVED[type(request)](self._lines[request.side], request, now)

    def _check_orders(self, orders: tuple[Order, ...]) -> Done:
        """A second order for a controller could rest on what the first changes."""
        addressees = Counter((order.side, order.controller) for order in orders)
        for (side, name), count in addressees.items():
            if count > 1:
                raise CommandRefused(f"Controller {name!r} of {side.value} is sent {count} orders at once; send one.")
        for order in orders:
            line = self._lines[order.side]
            line.check_follows()
            line.manager.check(order.controller, order.message, line.state)
        return Done()

    def _send_orders(self, orders: tuple[Order, ...]) -> Done:
        """All are checked before any is taken."""
        self._check_orders(orders)
        for order in orders:
            line = self._lines[order.side]
            line.manager.receive(order.controller, order.message, line.state)
        return Done()


def _load(line: ArmLine, request: LoadController, now: float) -> Done:
    line.manager.load_kind(request.name, request.kind, request.values)
    return _shown(line, now)


def _configure(line: ArmLine, request: ConfigureController, now: float) -> Done:
    try:
        line.manager.configure(request.name)
    finally:
        line.publish(now)
    return Done()


def _clean_up(line: ArmLine, request: CleanupController, now: float) -> Done:
    line.manager.clean_up(request.name)
    return _shown(line, now)


def _unload(line: ArmLine, request: UnloadController, now: float) -> Done:
    line.manager.unload(request.name)
    return _shown(line, now)


def _switch(line: ArmLine, request: SwitchControllers, now: float) -> Done:
    return Done(sentence=line.switch(request.activate, request.deactivate, now, request.strictness))


def _hold(line: ArmLine, request: HoldArm, now: float) -> Done:
    line.manager.deactivate_commanding()
    return _shown(line, now)


def _set_parameters(line: ArmLine, request: SetParameters, now: float) -> Done:
    line.manager.set_parameters(request.controller, request.values)
    return Done()


def _list_parameters(line: ArmLine, request: ListParameters, now: float) -> Done:
    return Done(parameters=line.manager.parameters(request.controller))


def _list_controllers(line: ArmLine, request: ListControllers, now: float) -> Done:
    return Done(controllers=line.manager.controllers())


def _list_kinds(line: ArmLine, request: ListControllerKinds, now: float) -> Done:
    return Done(kinds=line.manager.kinds)


def _list_hardware(line: ArmLine, request: ListHardware, now: float) -> Done:
    return Done(hardware=(line.manager.hardware(),))


def _set_hardware_state(line: ArmLine, request: SetHardwareState, now: float) -> Done:
    info = line.manager.set_hardware_state(request.name, request.state)
    line.publish(now)
    return Done(hardware=(info,))


def _shown(line: ArmLine, now: float) -> Done:
    """Done, and to be seen in the snapshot."""
    line.publish(now)
    return Done()


_SERVED: Mapping[type, Serve] = {
    LoadController: _load,
    ConfigureController: _configure,
    CleanupController: _clean_up,
    UnloadController: _unload,
    SwitchControllers: _switch,
    HoldArm: _hold,
    SetParameters: _set_parameters,
    ListParameters: _list_parameters,
    ListControllers: _list_controllers,
    ListControllerKinds: _list_kinds,
    ListHardware: _list_hardware,
    SetHardwareState: _set_hardware_state,
}
