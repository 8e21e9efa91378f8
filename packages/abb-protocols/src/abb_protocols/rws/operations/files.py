"""Operations on the controller's disk (``/fileservice``)."""

from __future__ import annotations

from abb_protocols.rws.operations.operation import delete, get, post, put
from abb_protocols.rws.values import Grant

_PATH = "/fileservice/{path:.+}"

DISKS = get("/fileservice", grant=Grant.FTP_READ)
FILE = get(_PATH, grant=Grant.FTP_READ)
HEAD_FILE = post(_PATH, method="HEAD", grant=Grant.FTP_READ)
PUT_FILE = put(_PATH, grant=Grant.FTP_WRITE)
CHANGE_FILE = post(
    _PATH, None, "fs-action=create|copy|rename, fs-newname, fs-overwrite=true|false", grant=Grant.FTP_WRITE
)
DELETE_FILE = delete(_PATH, grant=Grant.FTP_WRITE)
