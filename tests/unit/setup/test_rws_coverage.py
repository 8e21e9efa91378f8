"""The tables that list the operations of Robot Web Services."""

from __future__ import annotations

import rws_coverage


def test_no_operation_is_listed_twice() -> None:
    keys = [(each.method, each.path, each.action, each.resource) for each in rws_coverage.operations()]
    assert len(set(keys)) == len(keys)


def test_most_operations_are_answered() -> None:
    assert sum(each.success < 400 for each in rws_coverage.operations()) >= 150
