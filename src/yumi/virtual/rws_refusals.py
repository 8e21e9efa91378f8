"""The controller's refusals in the words of Robot Web Services: HTTP status, ABB's code, message (rws.md §3.4)."""

from __future__ import annotations

from collections.abc import Mapping

from yumi.rws.codes import Code
from yumi.rws.pages import Status
from yumi.virtual.refusal import Refusal, Refused
from yumi.virtual.rws_routes import Failure

_ANSWERS: Mapping[Refusal, tuple[int, Code]] = {
    Refusal.WRONG_MODE: (403, Code.MODE_REJECT),
    Refusal.MOTORS_OFF: (400, Code.EXEC_STATE),
    Refusal.NOT_STOPPED: (400, Code.EXEC_STATE),
    Refusal.ALREADY_RUNNING: (400, Code.EXEC_STATE),
    Refusal.NO_PROGRAM_POINTER: (400, Code.EXEC_STATE),
    Refusal.READ_ONLY: (403, Code.REJECT),
    Refusal.UNKNOWN: (404, Code.UNRESOLVED_URL),
    Refusal.OUT_OF_RANGE: (400, Code.INVALIDARG),
    Refusal.EMERGENCY_STOP: (403, Code.INVALID_STATE),
    Refusal.BAD_VALUE: (400, Code.INVALIDARG),
    Refusal.NO_FILE: (400, Code.FILE_NOT_FOUND),
    Refusal.NO_MODULE: (400, Code.NO_SUCH_SYMBOL),
    Refusal.NAME_TAKEN: (400, Code.MODULE_NAME_TAKEN),
    Refusal.BAD_PROGRAM: (400, Code.SYNTAX),
    Refusal.NO_SPACE: (507, Code.MAX_LIMIT_REACHED),
}


def failure(refused: Refused) -> Failure:
    """The answer to a request the controller refuses."""
    status, code = _ANSWERS[refused.reason]
    return Failure(status, code, str(refused))


def status_of(failure: Failure, service: str) -> Status:
    """The error document of an answer, its message in the controller's shape."""
    sentence = str(failure).rstrip(".")
    message = f"rws_resource_{service}.cpp[1] {sentence} code:{int(failure.code)} icode:-1"
    return Status(int(failure.code), message)
