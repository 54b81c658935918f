"""Packages whose public names are imported when they are asked for, so that who asks for one does not wait for all."""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

__all__ = ["deferred"]


def deferred(package: str, homes: Mapping[str, str]) -> Callable[[str], Any]:
    """Makes the `__getattr__` of a package.

    Args:
        package: its name.
        homes: of each public name, the module below the package that has it.

    Returns:
        A function of a name that imports it. It raises AttributeError for another name, with those that there are.
    """

    def get(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}; it has {', '.join(homes)}")
        return getattr(import_module(f"{package}.{homes[name]}"), name)

    return get
