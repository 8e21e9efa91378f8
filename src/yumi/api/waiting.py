"""Waiting for motions: whoever stops waiting, for whatever reason, leaves no arm moving."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import FIRST_EXCEPTION
from concurrent.futures import wait as wait_for_futures
from contextlib import suppress

from yumi.api.guidance import Guidance
from yumi.api.motions import LAST_STOP, Motion
from yumi.errors import GoalNotReached, YumiError


def wait_for(motions: Sequence[Motion], timeout: float | None, guidance: Guidance) -> None:
    """Wait until all ``motions`` are at their goals; on any other way out those that still move are stopped.

    Args:
        motions: begun together.
        timeout: longest wait [s]; None waits until they end.
        guidance: what stops the arms.

    Raises:
        GoalNotReached: a motion ended elsewhere, or its time was up.
    """
    try:
        wait_for_futures([motion.future for motion in motions], timeout, FIRST_EXCEPTION)
        check_ended(motions, timeout)
    except BaseException:  # Ctrl-C too
        halt(motions, guidance)
        raise


def check_ended(motions: Iterable[Motion], timeout: float | None) -> None:
    """Look how motions ended that were waited for.

    Raises:
        GoalNotReached: one ended elsewhere, or is not over.
    """
    for motion in [each for each in motions if each.is_done]:
        motion.future.result()
    late = [motion.side.word for motion in motions if not motion.is_done]
    if late:
        arms = " and ".join(late)
        raise GoalNotReached(f"The {arms} arm did not arrive within {timeout:g} s and was stopped.")


def halt(motions: Iterable[Motion], guidance: Guidance) -> None:
    """Stop the arms of those motions that are under way, and wait until they stand."""
    with suppress(YumiError):  # what ended the wait is what a person must read; the fast line holds what it can
        for stopping in guidance.stop([motion.side for motion in motions if not motion.is_done]):
            stopping.wait(LAST_STOP)
