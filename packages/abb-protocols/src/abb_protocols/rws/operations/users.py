"""Operations on users, their grants, and the remote manual mode privilege (``/users``)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from abb_protocols.rws.operations.operation import get, post
from abb_protocols.rws.operations.operation_answer import WHOLE, Spelling, choice, record

_LOCALE = choice("local", "remote")


@dataclass(frozen=True, slots=True)
class User:
    """A client that is logged in, as it has introduced itself; it is local at the FlexPendant."""

    uid: int
    name: Annotated[str, "alias"] = ""
    location: str = ""
    application: str = ""
    is_local: Annotated[bool, "ulocale", _LOCALE] = False


USERS = get("/users", "user-type=self").shows(record("user", User))
REGISTER = post("/users", None, "username, application, location, ulocale=local|remote", status=201)
IMPERSONATE = post("/users", "impersonate", "uid", status=200)
SET_LOCALE = post("/users", "set-locale", "type=local|remote", status=200)
GRANTS = get("/users/grants")
RMMP = get("/users/rmmp")
RMMP_USER = record(
    "user-rmmp", User, uid=("userid", WHOLE), is_local=("ulocale", Spelling(_LOCALE.read, lambda name, is_local: {}))
)
"""Who has the privilege, in the state of ``RMMP``."""

REQUEST_RMMP = post("/users/rmmp", None, "privilege=modify|exec", status=202)
GRANT_RMMP = post("/users/rmmp", "set", "uid, privilege=modify|exec|deny")
CANCEL_RMMP = post("/users/rmmp", "cancel")
POLL_RMMP = get("/users/rmmp/poll")
REMOTE_LOGIN = post("/users/remoteuser", "remotelogin")
REMOTE_LOGOUT = post("/users/remoteuser", "remotelogout")
LOGOUT = get("/logout", status=204)
