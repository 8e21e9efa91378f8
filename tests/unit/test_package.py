"""What ``import yumi`` and ``python -m yumi`` offer before anything is connected."""

from __future__ import annotations

import runpy
import sys

import pytest

import yumi


def test_completion_lists_what_a_script_needs_and_nothing_else() -> None:
    assert dir(yumi) == sorted(yumi.__all__)
    assert {"connect", "connect_async", "attach", "degrees", "abb_degrees", "pose", "errors"} <= {*dir(yumi)}
    for name in yumi.__all__:
        assert getattr(yumi, name) is not None, name


def test_name_that_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'yumi' has no attribute 'no_such_name'"):
        _ = yumi.no_such_name


def test_package_is_the_command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "argv", ["yumi", "--version"])
    with pytest.raises(SystemExit) as ended:
        runpy.run_module("yumi", run_name="__main__")
    assert ended.value.code == 0
    assert capsys.readouterr().out == f"yumi, version {yumi.__version__}\n"
