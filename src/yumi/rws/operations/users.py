"""Users, their grants, and the remote manual mode privilege."""

from __future__ import annotations

from yumi.rws.operations.operation import get, post

USERS = get("/users", "user-type=self")
REGISTER = post("/users", None, "username, application, location, ulocale=local|remote", status=201)
IMPERSONATE = post("/users", "impersonate", "uid", status=200)
SET_LOCALE = post("/users", "set-locale", "type=local|remote", status=200)
GRANTS = get("/users/grants")
RMMP = get("/users/rmmp")
REQUEST_RMMP = post("/users/rmmp", None, "privilege=modify|exec", status=202)
GRANT_RMMP = post("/users/rmmp", "set", "uid, privilege=modify|exec|deny")
CANCEL_RMMP = post("/users/rmmp", "cancel")
POLL_RMMP = get("/users/rmmp/poll")
REMOTE_LOGIN = post("/users/remoteuser", "remotelogin")
REMOTE_LOGOUT = post("/users/remoteuser", "remotelogout")
LOGOUT = get("/logout", status=204)
