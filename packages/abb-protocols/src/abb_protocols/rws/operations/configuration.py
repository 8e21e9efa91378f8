"""Operations on system parameters (``/rw/cfg``)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from abb_protocols.rws.operations.operation import delete, get, post
from abb_protocols.rws.operations.operation_answer import flag, pair, record
from abb_protocols.rws.values import Grant

_TYPE = "/rw/cfg/{domain}/{type}"
_DOMAIN = "/rw/cfg/{domain}"


@dataclass(frozen=True, slots=True)
class CfgAttribute:
    """An attribute of a type.

    Attributes:
        name: of it.
        type: such as ``string`` or ``float``.
        count: number of values.
        lowest, highest: limits of its value, or of its length.
        initial: value of a new instance.
        is_mandatory: whether an instance must have it.
    """

    name: str
    type: str
    count: Annotated[str, "numbers"] = "1"
    lowest: Annotated[str, "mini"] = ""
    highest: Annotated[str, "max"] = ""
    initial: Annotated[str, "init"] = ""
    is_mandatory: Annotated[bool, "mandatory", flag("true", "false")] = False


DOMAINS = get("/rw/cfg")
LOAD_FILE = post(
    "/rw/cfg", "load", "filepath, action-type=add|replace|add-with-reset", needs="cfg", grant=Grant.CFG_WRITE
)
VALIDATE_FILE = post("/rw/cfg", "validate", "filepath, action-type=add|replace|add-with-reset", status=200)
VALIDATE_REMOVAL = post("/rw/cfg", "validate-inst-at-del", "name")
VALIDATE_INSTANCES = post(
    "/rw/cfg", "validate-instances", "operation=0|1, cfgdomain, cfgtype, instances, instancescount"
)
KEYLESS = post("/rw/cfg", "keyless", "state=run", status=403)
TYPES = get(_DOMAIN, "start, limit")
SAVE_DOMAIN = post(_DOMAIN, "saveas", "filepath, save-mode", grant=Grant.BACKUP)
RESET_DOMAIN = post(_DOMAIN, "reset", needs="cfg", grant=Grant.CFG_WRITE, status=200)
TYPE = get(_TYPE).shows(pair("cfg-dt", "cfg-no-of-attributes", "cfg-no-of-instances"))
ATTRIBUTES = get(f"{_TYPE}/attributes").shows(record("cfg-dt-attribute-li", CfgAttribute))
INSTANCES = get(f"{_TYPE}/instances", "start, limit")
RESET_INSTANCES = post(f"{_TYPE}/instances", "reset", needs="cfg", grant=Grant.CFG_WRITE)
CREATE_INSTANCE = post(f"{_TYPE}/instances", "create-default", "name", needs="cfg", grant=Grant.CFG_WRITE, status=201)
INSTANCE = get(f"{_TYPE}/instances/{{instance}}")
SET_INSTANCE = post(f"{_TYPE}/instances/{{instance}}", "set", needs="cfg", grant=Grant.CFG_WRITE)
REMOVE_INSTANCE = delete(f"{_TYPE}/instances/{{instance}}", needs="cfg", grant=Grant.CFG_WRITE)
