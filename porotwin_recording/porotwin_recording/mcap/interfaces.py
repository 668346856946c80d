"""Access to generated ROS 2 message classes by name."""

import importlib
from typing import Any

from porotwin_core.basis.errors import InputError


def message_class(type_name: str) -> type[Any]:
    """Return the message class of `type_name` (pkg/msg/Name).

    Raises:
        InputError: the type is not installed.
    """
    package, _, name = type_name.partition('/msg/')
    try:
        found: type[Any] = getattr(importlib.import_module(f'{package}.msg'), name)
    except (ImportError, AttributeError):
        raise InputError(
            f"message type '{type_name}' is not installed here; source the workspace that has it"
        ) from None
    return found
