"""Puts the built page into a wheel, so that installing it needs no Node.js: a build hook of Hatch."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from hatchling.builders.config import BuilderConfig
from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class PageHook(BuildHookInterface[BuilderConfig]):
    """Adds the page; an editable installation builds it when it needs to."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build the page and add it."""
        if version != "standard":
            return
        root = Path(self.root)
        sys.path[:0] = [str(each) for each in (root / "src", root.parent / "abb-protocols" / "src") if each.exists()]
        from abb_view.page_build import CONTROLLER_PAGE, built  # noqa: PLC0415 - that of the sources

        packaged = CONTROLLER_PAGE.packaged.relative_to(root / "src").as_posix()
        build_data["force_include"][str(built(CONTROLLER_PAGE, self.app.display_info))] = packaged
