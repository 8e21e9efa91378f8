"""ABB's return codes and what they mean to a person (reference/rws.md §3.4-3.5)."""

from __future__ import annotations

from enum import IntEnum


class Code(IntEnum):
    """Return codes of the controller that a client meets; names as in ABB's table."""

    NOTIMPL = -1073445886
    NO_DATA = -1073445883
    REJECT = -1073445881
    RESOURCE_NOT_HELD = -1073445880
    INVALIDARG = -1073445879
    LOCAL_NOT_ALLOWED = -1073445875
    NOT_LOGGED_ON = -1073445873
    MAX_LIMIT_REACHED = -1073445871
    NO_SUCH_REQUEST = -1073445870
    TIMEOUT = -1073445869
    UAS_REJECT = -1073445867
    UNRESOLVED_URL = -1073445866
    DENIED = -1073445863
    RESOURCE_HELD = -1073445862
    MODE_REJECT = -1073445860
    MASTER_REJECT = -1073445859
    SYSFAIL_REJECT = -1073445851
    NO_SUCH_SYMBOL = -1073442816
    MODULE_NAME_TAKEN = -1073442813
    MODULE_WRITE_PROTECTED = -1073442810
    EXEC_STATE = -1073442809
    TASK_STATE = -1073442808
    SYNTAX = -1073442803
    SEMANTIC = -1073442802
    SYMBOL_NOT_PERSISTENT = -1073442786
    NO_PP = -1073442783
    FILE_NOT_FOUND = -1073438708
    CFG_DOMAIN_INVALID = -1073437696
    CFG_TYPE_INVALID = -1073437695
    CFG_INSTANCE_INVALID = -1073437691
    NO_SUCH_MECHUNIT = -1073436668
    UNBLOCKED_INSIGNAL = -1073438206
    INVALID_STATE = -1073435887
    FAIL = -1073414146
    UNEXPECTED = -1073414145


_SENTENCES = {
    Code.REJECT: 'the controller does not let remote clients write this; a signal needs Access "All"',
    Code.UNEXPECTED: 'the controller does not let remote clients write this; a signal needs Access "All"',
    Code.INVALIDARG: "a value in the request is not allowed",
    Code.UAS_REJECT: "the user lacks the grant for it; log in as another user",
    Code.UNRESOLVED_URL: "the controller has nothing of that name",
    Code.DENIED: "the controller denied it",
    Code.RESOURCE_HELD: "another client holds the mastership; release it there (FlexPendant, RobotStudio)",
    Code.MODE_REJECT: "the operating mode forbids it; switch the controller to AUTO",
    Code.MASTER_REJECT: "it needs the mastership, which another client or, in manual mode, the FlexPendant "
    "holds; switch to AUTO and release the mastership there",
    Code.SYSFAIL_REJECT: "the controller is in system failure; restart it",
    Code.NO_SUCH_SYMBOL: "no such RAPID symbol; load the robot-side program, or check the name",
    Code.EXEC_STATE: "the state of the RAPID execution forbids it; starting needs motors on, a program "
    "pointer and stopped tasks, moving the program pointer needs stopped tasks",
    Code.TASK_STATE: "the state of the RAPID task forbids it; check that its program loads without errors",
    Code.SYNTAX: "the value is not a RAPID value of the symbol's type, or the module is not RAPID",
    Code.MODULE_NAME_TAKEN: "the task has a module of that name; unload it first, or replace it",
    Code.FILE_NOT_FOUND: "the controller has no such file; upload it first",
    Code.MAX_LIMIT_REACHED: "the controller grants no more of these; end one first",
    Code.SYMBOL_NOT_PERSISTENT: "the variable is not persistent; only PERS can be subscribed",
    Code.SEMANTIC: "the value does not fit the symbol's type",
    Code.NO_PP: "no task has a program pointer; move it to main first",
    Code.CFG_TYPE_INVALID: "the configuration has no such type",
    Code.CFG_DOMAIN_INVALID: "the configuration has no such domain",
    Code.NO_SUCH_MECHUNIT: "the controller has no such mechanical unit",
    Code.UNBLOCKED_INSIGNAL: "a device drives this input signal; only outputs and virtual inputs are written",
    Code.INVALID_STATE: "the controller's state forbids it; release the emergency or guard stop first",
}


def name_of(code: int) -> str:
    """ABB's name of ``code``, or "" for one we do not know."""
    return next((known.name for known in Code if known == code), "")


def sentence(code: int | None) -> str | None:
    """What ``code`` means and what to do about it, or None when we have no words of our own for it."""
    return next((words for known, words in _SENTENCES.items() if known == code), None)
