from __future__ import annotations

import os

import pytest

from yumi.errors import RobotNotReady
from yumi.links.only import Only

NAME = f"yumi-test-{os.getpid()}"


def test_only_one_may_claim_a_name_and_the_other_learns_who_did() -> None:
    first, second = (Only(NAME, "Another one runs ({owner}); stop it.") for _ in range(2))
    first.claim()
    with pytest.raises(RobotNotReady, match=rf"Another one runs \(process {os.getpid()}\); stop it"):
        second.claim()
    first.release()
    second.claim()
    second.release()
