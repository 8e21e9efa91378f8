"""Operations on the event log (``/rw/elog``)."""

from __future__ import annotations

from abb_protocols.rws.operations.operation import get, post
from abb_protocols.rws.values import Grant

_DOMAIN = "/rw/elog/{domain}"

LOGS = get("/rw/elog", "lang, resource=count")
CLEAR_ALL = post("/rw/elog", "clearall", grant=Grant.EVENTLOG_CLEAR)
SAVE_EVENTS = post("/rw/elog", "saveraw", "path", grant=Grant.FTP_WRITE, status=202)
EVENTS = get(_DOMAIN, "lang, resource=count|info|title, order=lifo|fifo, elogseqnum, start, limit")
CLEAR = post(_DOMAIN, "clear", grant=Grant.EVENTLOG_CLEAR)
EVENT = get(f"{_DOMAIN}/{{number}}", "lang")
