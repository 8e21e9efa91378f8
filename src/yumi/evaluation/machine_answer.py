"""A round trip to the state machine and back, in virtual time and over the wire: it runs a routine that answers.

The application gives the right arm's task a number, has the state machine run a routine that copies it, and reads the
copy until the number is there. A subscription would not do: a controller tells the next change 50 ms later at the
earliest, and a round trip after the other would measure that.
"""

from __future__ import annotations

from collections.abc import Callable

from yumi.errors import RobotNotReady
from yumi.hardware.rws_client import RwsClient
from yumi.hardware.state_machine import RAPID, RUN_RAPID
from yumi.robot.joints import Side

SIDE = Side.RIGHT
"""Whose state machine is asked."""

MODULE = "EvaluationAnswer"
FILE_NAME = f"{MODULE}.mod"
TEXT = f"""MODULE {MODULE}
    VAR num asked:=-1;
    PERS num answered:=-1;

    PROC answer()
        answered:=asked;
    ENDPROC
ENDMODULE
"""
"""The module with the routine, to be loaded into the task."""

_LONGEST = 1.0  # [s] an answer that takes longer does not come
_ROUTINE = "routine_name_input"


def prepare(client: RwsClient) -> None:
    """After the module was loaded: have only our task run a routine when both see the signal's next edge."""
    client.set_symbol(SIDE.other.task, RAPID, _ROUTINE, '""')
    client.set_signal(RUN_RAPID, 0)


def machine_trip(
    client: RwsClient, number: str, now: Callable[[], float], pause: Callable[[], None]
) -> tuple[float, float]:
    """Have the idle state machine answer ``number``.

    Args:
        client: asks the controller.
        number: one that it was not asked before.
        now: tells the time [s].
        pause: called before each look for the answer.

    Returns:
        Until it had been asked, and from then until its answer was read [s].

    Raises:
        RobotNotReady: it did not answer.
    """
    begin = now()
    client.set_symbol(SIDE.task, MODULE, "asked", number)
    client.set_symbol(SIDE.task, RAPID, _ROUTINE, '"answer"')
    client.set_signal(RUN_RAPID, 1)
    asked = now()
    _wait_until(lambda: client.symbol(SIDE.task, MODULE, "answered") == number, now, pause)
    answered = now()
    client.set_signal(RUN_RAPID, 0)
    _wait_until(lambda: client.symbol(SIDE.task, RAPID, _ROUTINE) == '""', now, pause)
    return asked - begin, answered - asked


def _wait_until(is_so: Callable[[], bool], now: Callable[[], float], pause: Callable[[], None]) -> None:
    end = now() + _LONGEST
    pause()
    while not is_so():
        if now() > end:
            raise RobotNotReady(f"The state machine of the {SIDE.word} arm did not answer within {_LONGEST:g} s.")
        pause()
