"""A client's answer to a digest challenge, as httpx gives it."""

from __future__ import annotations

import httpx


def authorization(challenge: str, *, user: str, password: str, method: str, uri: str) -> str:
    """The ``Authorization`` value for one request."""
    request = httpx.Request(method, f"http://yumi{uri}")
    login = httpx.DigestAuth(user, password).auth_flow(request)
    next(login)
    challenged = httpx.Response(401, headers={"WWW-Authenticate": challenge}, request=request)
    return login.send(challenged).headers["Authorization"]
