from __future__ import annotations

from math import nan

import numpy as np
import pytest

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.description import HAND, Mass
from abb_protocols.robot.joints import Pose, rotate
from abb_protocols.robot.load import Tool, principal_inertia
from refusals import refused

IDENTITY = (1.0, 0.0, 0.0, 0.0)
NO_INERTIA = (0.0,) * 6
CUP = Mass(0.12, (0.03, -0.02, 0.15), (2e-4, 1e-5, -2e-5, 3e-4, 4e-5, 1e-4))


def tensor(inertia: tuple[float, ...]) -> np.ndarray:
    xx, xy, xz, yy, yz, zz = inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def about_flange(body: Mass) -> np.ndarray:
    centre = np.array(body.centre)
    return tensor(body.inertia) + body.mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))


def test_tool_and_payload_together_have_the_mass_the_moment_and_the_inertia_of_both() -> None:
    total = Tool(load=HAND, payload=CUP).total
    assert total.mass == pytest.approx(HAND.mass + CUP.mass)
    moment = HAND.mass * np.array(HAND.centre) + CUP.mass * np.array(CUP.centre)
    assert total.mass * np.array(total.centre) == pytest.approx(moment)
    assert about_flange(total) == pytest.approx(about_flange(HAND) + about_flange(CUP))


def test_tool_without_payload_is_itself() -> None:
    assert Tool(load=HAND).total == Mass(HAND.mass, pytest.approx(HAND.centre), pytest.approx(HAND.inertia))


@pytest.mark.parametrize("body", [HAND, CUP, Tool(load=HAND, payload=CUP).total], ids=["hand", "cup", "both"])
def test_principal_axes_and_moments_are_those_of_the_tensor(body: Mass) -> None:
    axes, moments = principal_inertia(body)
    assert sorted(moments) == pytest.approx(list(np.linalg.eigvalsh(tensor(body.inertia))), abs=1e-12)
    rotation = np.array([rotate(axes, each) for each in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]).T
    assert rotation @ np.diag(moments) @ rotation.T == pytest.approx(tensor(body.inertia), abs=1e-12)


@pytest.mark.parametrize(
    ("tool", "code", "values"),
    [
        ({"load": Mass(nan, (0.0, 0.0, 0.0), NO_INERTIA)}, "load_not_finite", {"part": "tool"}),
        (
            {"payload": Mass(-0.1, (0.0, 0.0, 0.0), NO_INERTIA)},
            "load_out_of_range",
            {"part": "payload", "mass": -0.1, "distance": 0.0},
        ),
        (
            {"payload": Mass(0.1, (0.0, 0.0, 52.0), NO_INERTIA)},
            "load_out_of_range",
            {"part": "payload", "mass": 0.1, "distance": 52.0},
        ),
        (
            {"load": HAND, "payload": Mass(0.4, (0.0, 0.0, 0.1), NO_INERTIA)},
            "load_too_heavy",
            {"mass": 0.63, "most": 0.5},
        ),
        ({"load": Mass(0.1, (0.0, 0.0, 0.0), (-1e-4, 0.0, 0.0, 0.0, 0.0, 0.0))}, "inertia_negative", {"part": "tool"}),
        (
            {"tcp": Pose((0.0, 0.0, 114.2), IDENTITY)},
            "tcp_too_far",
            {"position": (0.0, 0.0, 114.2), "farthest": 0.5},
        ),
        (
            {"tcp": Pose((0.0, 0.0, 0.1), (0.0, 0.0, 0.0, 0.0))},
            "tcp_not_unit",
            {"orientation": (0.0, 0.0, 0.0, 0.0)},
        ),
    ],
)
def test_impossible_tool_is_refused(tool: dict[str, object], code: str, values: dict[str, object]) -> None:
    with refused(CommandRefused, code, **values):
        Tool(**tool)  # type: ignore[arg-type]
