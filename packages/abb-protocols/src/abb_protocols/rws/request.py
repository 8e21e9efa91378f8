"""A request of Robot Web Services and the reply to it, free of connection and session."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol
from urllib.parse import quote

from abb_protocols.rws.documents import FORM_TYPE, Pairs, encode_form

BUSY_STATUS = 503
"""Status of HTTP of a controller that has no session left, or no time."""

_PATH_SAFE = "/;:$@-._~"


@dataclass(frozen=True, slots=True)
class RwsRequest:
    """A request.

    Attributes:
        method: of HTTP.
        path: resource, unescaped.
        query: parameters in the URL.
        form: parameters in the body; None for a request without a body.
        content: a file in the body instead of a form.
    """

    method: str
    path: str
    query: Pairs = ()
    form: Pairs | None = None
    content: bytes | None = None

    @property
    def target(self) -> str:
        """Path and query as on the request line."""
        path = quote(self.path, safe=_PATH_SAFE)
        return f"{path}?{encode_form(self.query)}" if self.query else path

    @property
    def body(self) -> bytes:
        """The file, or the form, encoded."""
        return encode_form(self.form or ()).encode("ascii") if self.content is None else self.content

    @property
    def content_type(self) -> str | None:
        """What the body is; None for a request without one."""
        if self.content is not None:
            return "application/octet-stream"
        return None if self.form is None else FORM_TYPE

    @property
    def is_transfer(self) -> bool:
        """Whether it carries the content of a file, which takes as long as it is long."""
        return self.method in ("GET", "PUT") and self.path.startswith("/fileservice")

    @property
    def is_repeatable(self) -> bool:
        """Whether sending it twice does no more than sending it once."""
        return self.method in ("GET", "PUT")


class RwsReply(Protocol):
    """The reply to a request, complete; a response of httpx is one."""

    @property
    def status_code(self) -> int: ...

    @property
    def headers(self) -> Mapping[str, str]: ...

    @property
    def content(self) -> bytes: ...
