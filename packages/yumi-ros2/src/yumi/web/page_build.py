"""The page of ``yumi view``: where its sources are, built on the shell of abb-view."""

from __future__ import annotations

from pathlib import Path

from abb_view.page_build import PageSources, main

ROBOT_PAGE = PageSources(Path(__file__).with_name("page"), Path(__file__).with_name("static"))
"""The page of a driver's robot, and of a recording."""

if __name__ == "__main__":
    main(ROBOT_PAGE)
