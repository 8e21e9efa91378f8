"""The states of the limiter, and the one table of the transitions between them.

Each datagram, each command and each interruption is an event. ``setup/limiter_states.py`` makes the page of the
documentation from this, docs/reference/limiter-states.md, and its picture.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum


class LimiterState(IntEnum):
    """What the limiter does with an arm, see ``LIMITER_STATE_MEANINGS``."""

    NO_SESSION = 0
    ENTERING = 1
    BEGINNING = 2
    STANDBY = 3
    FOLLOWING = 4
    SETTLING = 5
    HOLDING = 6
    WAITING = 7
    IGNORED = 8
    DOUBTED = 9
    LOST = 10
    INTERRUPTED = 11
    DISCONNECTED = 12


class LimiterEvent(IntEnum):
    """What leads from one state to another, see ``LIMITER_EVENT_MEANINGS``."""

    SESSION_ELSEWHERE = 0
    SESSION_LED = 1
    SESSION_NEW = 2
    SESSION_CONTINUED = 3
    FIRST_SENT = 4
    FEEDBACK_LOST = 5
    FEEDBACK_DOUBTED = 6
    NOT_FOLLOWING = 7
    IGNORING = 8
    REPEATING = 9
    BACK = 10
    UNDESIRED = 11
    UNUSABLE = 12
    DESIRED = 13
    INTERRUPTION = 14
    CONNECTION_LOST = 15
    UNANSWERED = 16


_S, _E = LimiterState, LimiterEvent

LIMITER_STATE_MEANINGS: Mapping[LimiterState, str] = {
    _S.NO_SESSION: "The robot was not heard yet, or only where no arm can be. Nothing is sent.",
    _S.ENTERING: "A session has begun, but the last command may still move the robot, or the arm is where that cannot "
    "have led it. Nothing is sent: a robot without a reply keeps its last reference. Each datagram is judged anew.",
    _S.BEGINNING: "A session has begun. The next command is where the robot is measured, so that it finds no step. "
    "Nothing is sent while that position cannot be believed.",
    _S.STANDBY: "The robot does not follow. The command goes to where the arm is, within the limits.",
    _S.FOLLOWING: "What is desired is sent, as far as the limits and the other arm allow.",
    _S.SETTLING: "The arm comes to rest within the limits, and its command goes back to where the arm is. What is "
    "desired is not taken until BACK, whatever comes between.",
    _S.HOLDING: "The arm comes to rest within the limits, then the last command is repeated. What is desired next is "
    "taken.",
    _S.WAITING: "The robot follows an older command: those since were lost. The command waits as near to the older one "
    "as the robot may set out to at once.",
    _S.IGNORED: "Commands lead the robot, and its plan stands. The arm holds whatever is desired, its command at "
    "most 0.001 rad ahead, and its controllers are deactivated. When the plan moves, the arm settles.",
    _S.DOUBTED: "No position can be believed. The command comes to rest within the limits, where it can. Controllers "
    "go on when a position can be believed.",
    _S.LOST: "No position could be believed for long. As DOUBTED, and the arm's controllers are deactivated. When "
    "a position can be believed, the arm settles.",
    _S.INTERRUPTED: "Nothing is calculated and nothing sent: the robot keeps its last reference. The other arm keeps "
    "clear of where that leads this one. Controllers go on when the robot is heard again.",
    _S.DISCONNECTED: "As INTERRUPTED, and the arm's controllers are deactivated. When the robot is heard again, the "
    "arm settles.",
}
"""What is done with an arm in each state."""

LIMITER_EVENT_MEANINGS: Mapping[LimiterEvent, str] = {
    _E.SESSION_ELSEWHERE: "a session begins where the arm cannot be, by its range, its plan or the last command",
    _E.SESSION_LED: "a session begins less than about 1 s after the last command, which still leads the robot on; or "
    "that datagram and the one before do not both show that it does not, or, later, that the robot stands there",
    _E.SESSION_NEW: "a session begins, and nothing was sent for about 1 s, or ever: no command can move the robot",
    _E.SESSION_CONTINUED: "a session begins less than about 1 s after the last command, which leads the robot nowhere, "
    "as two datagrams in a row show",
    _E.FIRST_SENT: "the first command of a session was sent",
    _E.FEEDBACK_LOST: "20 positions or more in a row that no joint could have reached",
    _E.FEEDBACK_DOUBTED: "5 positions or more in a row that no joint could have reached (before, the arm goes on as if "
    "it had moved as it was led)",
    _E.NOT_FOLLOWING: "the robot does not follow: motors, EGM or RAPID are off",
    _E.IGNORING: "the plan has stood still for 0.12 s although commands lead the robot",
    _E.REPEATING: "the robot goes on by one command, although others were sent since",
    _E.BACK: "the command is back where the arm is, or has been near for 1 s",
    _E.UNDESIRED: "nothing is desired, or the arm has to settle",
    _E.UNUSABLE: "what is desired is no number, or the command is further ahead than the robot's speed explains",
    _E.DESIRED: "a position is desired that can be taken",
    _E.INTERRUPTION: "no datagram for 20 ms, once",
    _E.CONNECTION_LOST: "no datagram for 80 ms, once",
    _E.UNANSWERED: "no controller has answered for 2 ms: the core answers",
}
"""What was seen at each event."""

_SESSIONS = {
    _E.SESSION_ELSEWHERE: _S.ENTERING,
    _E.SESSION_LED: _S.ENTERING,
    _E.SESSION_NEW: _S.BEGINNING,
    _E.SESSION_CONTINUED: _S.SETTLING,
}
_INTERRUPTIONS = {_E.INTERRUPTION: _S.INTERRUPTED, _E.CONNECTION_LOST: _S.DISCONNECTED}
_ARM = {
    **_SESSIONS,
    _E.NOT_FOLLOWING: _S.STANDBY,
    _E.FEEDBACK_DOUBTED: _S.DOUBTED,
    _E.IGNORING: _S.IGNORED,
    _E.REPEATING: _S.WAITING,
    _E.UNDESIRED: _S.SETTLING,
    _E.UNUSABLE: _S.HOLDING,
    _E.DESIRED: _S.FOLLOWING,
    _E.UNANSWERED: _S.HOLDING,
    **_INTERRUPTIONS,
}
_LOSS = {_E.FEEDBACK_LOST: _S.LOST}
SETTLING_STATES = (_S.SETTLING, _S.IGNORED, _S.LOST, _S.DISCONNECTED)
"""States after which an arm has to settle before anything that is desired is taken: what moved it has been ended."""


_SETTLING: Mapping[LimiterEvent, LimiterState] = {
    event: state for event, state in _ARM.items() if event not in (_E.DESIRED, _E.UNUSABLE, _E.UNANSWERED)
}

TRANSITIONS: Mapping[LimiterState, Mapping[LimiterEvent, LimiterState]] = {
    _S.NO_SESSION: {
        _E.SESSION_ELSEWHERE: _S.NO_SESSION,
        _E.SESSION_NEW: _S.BEGINNING,
        _E.INTERRUPTION: _S.NO_SESSION,
        _E.CONNECTION_LOST: _S.NO_SESSION,
    },
    _S.ENTERING: {**_SESSIONS, **_INTERRUPTIONS},
    _S.BEGINNING: {
        **_SESSIONS,
        _E.FIRST_SENT: _S.HOLDING,
        # Whatever comes before the first command, that is where the robot is measured.
        _E.FEEDBACK_LOST: _S.BEGINNING,
        _E.FEEDBACK_DOUBTED: _S.BEGINNING,
        _E.INTERRUPTION: _S.BEGINNING,
        _E.CONNECTION_LOST: _S.BEGINNING,
    },
    _S.STANDBY: _ARM,
    _S.FOLLOWING: _ARM,
    _S.SETTLING: {**_SETTLING, _E.BACK: _S.HOLDING},
    _S.HOLDING: _ARM,
    _S.WAITING: _ARM,
    _S.IGNORED: _SETTLING,
    _S.DOUBTED: {**_ARM, **_LOSS},
    _S.LOST: {**_SETTLING, **_LOSS},
    _S.INTERRUPTED: {**_ARM, **_LOSS},
    _S.DISCONNECTED: {**_SETTLING, **_LOSS},
}
"""What follows in each state on each event; an event that a state does not have is forbidden in that state."""


class ForbiddenTransition(RuntimeError):
    """An event in a state that has none such in the table: the program is wrong."""
