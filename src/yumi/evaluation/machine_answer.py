"""What round trips to the state machine ask of it, in virtual time and over the wire: it runs a routine that answers.

The application gives the right arm's task a number and has the state machine run a routine that copies it; the answer
comes back by subscription.
"""

from __future__ import annotations

from yumi.hardware.rws_client import RwsClient
from yumi.hardware.state_machine import RAPID, RUN_RAPID
from yumi.robot.joints import Side
from yumi.rws.subscriptions import variable_value

SIDE = Side.RIGHT
"""Whose state machine is asked."""

MODULE = "EvaluationAnswer"
TEXT = f"""MODULE {MODULE}
    VAR num asked:=-1;
    PERS num answered:=-1;

    PROC answer()
        answered:=asked;
    ENDPROC
ENDMODULE
"""
"""The module with the routine, to be loaded into the task."""

ANSWER = variable_value(SIDE.task, MODULE, "answered")
"""Where the answer is told."""

LONGEST = 1.0
"""An answer that takes longer does not come [s]."""

_ROUTINE = "routine_name_input"


def prepare(client: RwsClient) -> None:
    """Have only our task run a routine when both see the signal."""
    client.set_symbol(SIDE.other.task, RAPID, _ROUTINE, '""')


def ask(client: RwsClient, number: str) -> None:
    """Have the state machine answer ``number``; it is idle, and the signal is 0."""
    client.set_symbol(SIDE.task, MODULE, "asked", number)
    client.set_symbol(SIDE.task, RAPID, _ROUTINE, '"answer"')
    client.set_signal(RUN_RAPID, 1)


def release(client: RwsClient) -> None:
    """Take the signal back."""
    client.set_signal(RUN_RAPID, 0)


def is_idle(client: RwsClient) -> bool:
    """Whether the routine has ended; the machine clears its name when it becomes idle."""
    return client.symbol(SIDE.task, RAPID, _ROUTINE) == '""'
