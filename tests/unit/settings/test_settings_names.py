"""Where a robot's names are: its namespace, its frames and its tool."""

from __future__ import annotations

import pytest

from abb_protocols.errors import SettingsError
from refusals import refused
from yumi.driver.settings import RosSettings
from yumi.driver.state_machine import EgmMotionSettings

TOOL = "[TRUE,[[0,10,114.2],[0,1,0,0]],[0.23,[8.2,11.7,52],[1,0,0,0],0.00021,0.00024,0.00009]]"


@pytest.mark.parametrize(
    ("given", "root", "frames"),
    [
        ("", "", ""),
        ("cell1", "/cell1", "cell1/"),
        ("/cell1", "/cell1", "cell1/"),
        ("/lab/a_1/", "/lab/a_1", "lab/a_1/"),
    ],
)
def test_namespace_is_from_the_root_and_before_each_frame(given: str, root: str, frames: str) -> None:
    settings = RosSettings(namespace=given)
    assert (settings.root, settings.frames) == (root, frames)


@pytest.mark.parametrize("given", ["", "left_", "lab/"])
def test_frame_prefix_wins_over_the_namespace(given: str) -> None:
    assert RosSettings(namespace="cell1", frame_prefix=given).frames == given


@pytest.mark.parametrize("given", ["~", "1cell", "a//b", "cell 1", "a-b", "{a}"])
def test_namespace_that_ros_does_not_know_is_refused(given: str) -> None:
    with refused(SettingsError, "namespace_not_of_ros", setting="ros: namespace", value=given):
        RosSettings(namespace=given)


def test_tool_in_use_is_that_of_egm_in_metres_and_tool0_without_one() -> None:
    tool = EgmMotionSettings(tool=TOOL).tool_to_tool0
    assert tool.position == pytest.approx((0.0, 0.010, 0.1142))
    assert tool.orientation == (0.0, 1.0, 0.0, 0.0)
    bare = EgmMotionSettings().tool_to_tool0
    assert (bare.position, bare.orientation) == ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
