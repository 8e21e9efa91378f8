"""Orders for both arms, whose controllers live in processes of their own: all are taken or none."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from yumi.control.requests import CheckOrders, Done, HoldArm, Order, SendOrders
from yumi.errors import CommandRefused, YumiError
from yumi.robot.joints import Side

Ask = Callable[[Side, CheckOrders | SendOrders | HoldArm], Done]
"""Has a request served by one arm's fast line; raises what it raises."""


def check_orders(orders: Sequence[Order], ask: Ask) -> Done:
    """Whether every controller would take its order now; nothing is changed.

    Raises:
        CommandRefused: one would not.
    """
    for side, own in _by_side(orders).items():
        ask(side, CheckOrders(own))
    return Done()


def send_orders(orders: Sequence[Order], ask: Ask) -> Done:
    """Have every controller take its order: all are checked before any is taken.

    Should an arm have changed its mind between the two, the arms that took theirs are made to hold.

    Raises:
        CommandRefused: a controller does not take its order.
    """
    by_side = _by_side(orders)
    if len(by_side) > 1:  # one arm checks all of its own before it takes any
        check_orders(orders, ask)
    told: list[Side] = []
    for side, own in by_side.items():
        try:
            ask(side, SendOrders(own))
        except YumiError as refusal:
            for other in told:
                ask(other, HoldArm(other))
            held = "".join(f" The {other.word} arm had taken its order and holds." for other in told)
            raise CommandRefused(f"{refusal}{held}") from refusal
        told.append(side)
    return Done()


def _by_side(orders: Sequence[Order]) -> dict[Side, tuple[Order, ...]]:
    sides = dict.fromkeys(order.side for order in orders)
    return {side: tuple(order for order in orders if order.side is side) for side in sides}
