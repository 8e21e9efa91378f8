"""Debian's Chromium, driven by Playwright, for tests of the page; where one of the two is missing, they are skipped."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

ARGUMENTS = (
    *("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"),
    *("--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update"),
    "--disable-sync",
)


@contextmanager
def browser() -> Iterator[Any]:
    """A browser without a window, which renders WebGL 2 in software."""
    api = pytest.importorskip("playwright.sync_api", reason="the page is tested with playwright: not installed")
    program = shutil.which("chromium")
    if program is None:
        pytest.skip("the page is tested with Debian's chromium, which is not installed: apt-get install chromium")
    with api.sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=program, args=ARGUMENTS)
        try:
            yield chromium
        finally:
            chromium.close()
