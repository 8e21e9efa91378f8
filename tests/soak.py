"""How long the long forms of tests take, and where they tell how far they are; see ``make soak``."""

from __future__ import annotations

import os
import sys

import pytest

MINUTES = float(os.environ.get("YUMI_SOAK_MINUTES", "10"))
"""Of motion."""

CYCLES = int(os.environ.get("YUMI_SOAK_CYCLES", "200"))
"""Starts and stops of EGM."""

RECEIVE_EXAMPLES = int(os.environ.get("YUMI_RECEIVE_EXAMPLES", "2000"))
"""Of what may happen to datagrams."""

FUZZ_PROGRAMS = int(os.environ.get("YUMI_FUZZ_PROGRAMS", "600"))
"""Mutated RAPID programs."""

FUZZ_REQUESTS = int(os.environ.get("YUMI_FUZZ_REQUESTS", "20000"))
"""Of a client that sends nonsense."""

CONTROLLERS = int(os.environ.get("YUMI_SOAK_CONTROLLERS", "50"))
"""Virtual controllers, one after another."""

HAND_OVERS = int(os.environ.get("YUMI_HAND_OVERS", "1000"))
"""Random sequences of people, programs, devices and links that want the arms."""

SEED = int(os.environ.get("YUMI_SEED", "0"))
"""Of those: a long form is run in pieces with different ones."""

COLLISION_CYCLES = int(os.environ.get("YUMI_COLLISION_CYCLES", "1000000"))
"""In which both arms are driven at each other and at what stands around them."""


def short(value: float, *marks: pytest.MarkDecorator) -> object:
    """The form of a test that runs with all others."""
    return pytest.param(value, marks=marks, id="short")


def long(value: float, seconds: float) -> object:
    """The form that ``make soak`` runs; it has so many seconds."""
    return pytest.param(value, marks=(pytest.mark.soak, pytest.mark.timeout(seconds)), id="long")


def tell(sentence: str) -> None:
    """Show how far it is; pytest shows it at once with ``-s`` only."""
    sys.stdout.write(f"\n{sentence}")
    sys.stdout.flush()
