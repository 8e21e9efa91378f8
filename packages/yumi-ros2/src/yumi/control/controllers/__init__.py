"""The controllers, a module each, found by the type that each class has: ``kind``."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pkgutil import iter_modules

from abb_protocols.catalogue import message
from abb_protocols.errors import SettingsError
from yumi.control.controller import Controller


def find_controllers() -> Iterator[type[Controller]]:
    """The classes of controllers in the modules of this package that have a type of their own.

    Raises:
        SettingsError: two classes have the same type.
    """
    owners: dict[str, type[Controller]] = {}
    for found in iter_modules(__path__):
        module = import_module(f"{__name__}.{found.name}")
        for each in vars(module).values():
            is_own = isinstance(each, type) and each.__module__ == module.__name__ and "kind" in vars(each)
            if is_own and issubclass(each, Controller):
                if (other := owners.setdefault(each.kind, each)) is not each:
                    classes = tuple(f"{it.__module__}.{it.__name__}" for it in (other, each))
                    raise SettingsError(message("controllers_of_one_type", type=each.kind, classes=classes))
                yield each
