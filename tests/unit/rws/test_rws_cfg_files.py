"""What is written into cfg files of what Robot Web Services list."""

from __future__ import annotations

from abb_protocols.rws.cfg_files import CFG_FLAG, read_cfg, stated_attributes, write_cfg

LISTED = {
    "File": "HOME:/production.mod",
    "ModName": "",
    "Task": "T_ROB_R",
    "AllTask": "false",
    "AllMotionTask": "No",
    "Hidden": "true",
    "Shared": "Yes",
    "Order": "0",
}


def test_attributes_that_are_listed_with_their_default_values_are_not_stated() -> None:
    expected = {"File": "HOME:/production.mod", "Task": "T_ROB_R", "Hidden": CFG_FLAG, "Shared": CFG_FLAG, "Order": "0"}
    assert stated_attributes(LISTED) == expected
    assert stated_attributes(expected) == expected
    text = write_cfg("SYS:CFG_1.0:6:0::", [("CAB_TASK_MODULES", stated_attributes(LISTED))])
    assert '-File "HOME:/production.mod" -Task "T_ROB_R" -Hidden -Shared -Order 0' in text
    assert read_cfg(text).instances == (("CAB_TASK_MODULES", expected),)
