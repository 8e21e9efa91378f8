"""The lines of constraints.txt that the wheel needs with some extras, for the Python that runs this.

``make wheels`` writes them beside the wheels. pip installs them with ``--require-hashes --no-deps``: what was tested,
and nothing is resolved.

    python setup/requirements.py ros record > dist/requirements-ros.txt
"""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterable
from importlib.metadata import metadata, requires
from pathlib import Path

from installation import Clone, pins
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
NAME = "yumi-ros2"

ONLY_TO_BUILD = ("empy",)
"""What message packages are generated with, and nothing that runs imports; it is no wheel."""


def needed(extras: Iterable[str], excluded: Collection[str] = ()) -> frozenset[str]:
    """The packages that the wheel needs with ``extras``, which are installed here; those ``excluded`` are left out."""
    found: set[tuple[str, str]] = set()
    waiting = [(NAME, extra) for extra in ("", *extras)]
    while waiting:
        package, extra = waiting.pop()
        if (package, extra) in found or package in excluded:
            continue
        found.add((package, extra))
        for requirement in map(Requirement, requires(package) or ()):
            if requirement.marker is None or requirement.marker.evaluate({"extra": extra}):
                waiting += [(canonicalize_name(requirement.name), each) for each in ("", *requirement.extras)]
    return frozenset(name for name, _ in found) - {NAME}


def requirements(clone: Clone, extras: Iterable[str]) -> list[str]:
    """The pins of what the wheel needs, with their hashes.

    Raises:
        SystemExit: there is no such extra, or a package has no pin.
    """
    known = metadata(NAME).get_all("Provides-Extra") or []
    for extra in extras:
        if extra not in known:
            sys.exit(f"requirements: there is no extra {extra}; there are: {', '.join(known)}.")
    pinned = {}
    for pin in pins(clone):
        requirement = Requirement(pin.partition(" --hash")[0])
        if requirement.marker is None or requirement.marker.evaluate():
            pinned[canonicalize_name(requirement.name)] = pin
    lines = (clone.root / "setup" / "excluded.txt").read_text().splitlines()
    names = needed(extras, [*ONLY_TO_BUILD, *(line for line in lines if not line.startswith("#"))])
    missing = sorted(names - pinned.keys())
    if missing:
        sys.exit(f"requirements: constraints.txt has no pin of {', '.join(missing)}; run: make constraints")
    return [pinned[name] for name in sorted(names)]


if __name__ == "__main__":
    print("\n".join(requirements(Clone(ROOT), sys.argv[1:])))
