"""Names of a package whose modules are imported when the name is first asked for."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

from innerattn.errors import missing_library


def lazy_names(
    package: str, homes: Mapping[str, str], extras: Mapping[str, str] | None = None
) -> Callable[[str], Any]:
    """A module's `__getattr__` for names that live in its submodules.

    Args:
        package: full name of the package.
        homes: the submodule of each name.
        extras: the extra that brings all that a submodule needs, where libraries that it needs
            come with several.

    Raises:
        MissingLibraryError: (when a name is asked for) its module needs a library that is not
            installed; the message says how to install it.
    """

    def find(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        try:
            found = getattr(import_module(f"{package}.{homes[name]}"), name)
        except ModuleNotFoundError as error:
            extra = (extras or {}).get(homes[name], "")
            if missing := missing_library(f"{package}.{name}", error, extra):
                raise missing from error
            raise
        setattr(sys.modules[package], name, found)
        return found

    return find
