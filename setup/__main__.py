"""`make setup`: refuses with one sentence where the machine lacks something, else brings .venv up to date.

Arguments are parts of pyproject.toml, extras or groups, that .venv gets beside what it has.

Written in the syntax of Python 3.6, like prerequisites.py; the rest is imported once that has found no problem.
"""

import os
import sys

from prerequisites import first_problem, inspect_machine

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
INTERFACES = os.path.join(ROOT, "interfaces")


def _interface_packages() -> "tuple[str, ...]":
    folders = sorted(os.listdir(INTERFACES))
    return tuple(name for name in folders if os.path.exists(os.path.join(INTERFACES, name, "package.xml")))


def main() -> None:
    """Check, then install; exits with 1 and a sentence where either fails."""
    machine = inspect_machine(_interface_packages())
    problem = first_problem(machine)
    if problem:
        sys.exit("setup: " + problem)
    from commands import InstallationFailed  # noqa: PLC0415 - a newer syntax than an old Python reads
    from installation import install  # noqa: PLC0415

    try:
        install(ROOT, machine, sys.argv[1:])
    except InstallationFailed as failure:
        sys.exit(f"setup: {failure}")
    except KeyboardInterrupt:
        sys.exit("setup: interrupted; the next make setup goes on from here")


main()
