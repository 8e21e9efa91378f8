"""The controllers, a module each, found by the type that each class has: ``kind``."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pkgutil import iter_modules

from yumi.control.controller import Controller


def find_controllers() -> Iterator[type[Controller]]:
    """The classes of controllers in the modules of this package that have a type of their own."""
    for found in iter_modules(__path__):
        module = import_module(f"{__name__}.{found.name}")
        for each in vars(module).values():
            is_own = isinstance(each, type) and each.__module__ == module.__name__ and "kind" in vars(each)
            if is_own and issubclass(each, Controller):
                yield each
