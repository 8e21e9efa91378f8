from __future__ import annotations

import pytest

from yumi.control.requests import Ask, CheckOrders, Done, HoldArm, Order, SendOrders, check_orders, send_orders
from yumi.errors import CommandRefused
from yumi.robot.joints import Side

LEFT, RIGHT = Side.LEFT, Side.RIGHT
ONE, OTHER, MORE = Order(LEFT, "a", "go"), Order(RIGHT, "a", "go"), Order(LEFT, "b", "go")

Asked = list[tuple[Side, object]]


def fast_lines(asked: Asked, *refused: object) -> Ask:
    """Remember what they are asked; refuse what is named."""

    def ask(side: Side, request: CheckOrders | SendOrders | HoldArm) -> Done:
        asked.append((side, request))
        if request in refused:
            raise CommandRefused("No.")
        return Done()

    return ask


def test_orders_are_all_checked_before_any_is_taken() -> None:
    asked: Asked = []
    send_orders((ONE, OTHER, MORE), fast_lines(asked))
    assert asked == [
        (LEFT, CheckOrders((ONE, MORE))),
        (RIGHT, CheckOrders((OTHER,))),
        (LEFT, SendOrders((ONE, MORE))),
        (RIGHT, SendOrders((OTHER,))),
    ]


def test_orders_are_taken_by_no_arm_when_one_would_refuse() -> None:
    asked: Asked = []
    with pytest.raises(CommandRefused, match=r"^No\.$"):
        send_orders((ONE, OTHER), fast_lines(asked, CheckOrders((OTHER,))))
    assert asked == [(LEFT, CheckOrders((ONE,))), (RIGHT, CheckOrders((OTHER,)))]


def test_arm_that_took_its_order_holds_when_the_other_changes_its_mind() -> None:
    asked: Asked = []
    with pytest.raises(CommandRefused, match=r"^No\. The left arm had taken its order and holds\.$"):
        send_orders((ONE, OTHER), fast_lines(asked, SendOrders((OTHER,))))
    assert asked[-1] == (LEFT, HoldArm(LEFT))


def test_checking_orders_sends_none() -> None:
    asked: Asked = []
    check_orders((ONE,), fast_lines(asked))
    assert asked == [(LEFT, CheckOrders((ONE,)))]
