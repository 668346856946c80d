"""Finds the panels of the page: every module in the folder `panels` declares one as PANEL."""

import functools
import importlib
import pkgutil

from porotwin_page import panels
from porotwin_page.panel import Panel


@functools.cache
def all_panels() -> dict[str, Panel]:
    """Return all panels by the names of their modules, ordered by `order` and name.

    Raises:
        TypeError: a module has no PANEL of a known kind.
    """
    found: dict[str, Panel] = {}
    for module in pkgutil.iter_modules(panels.__path__):
        name = f'{panels.__name__}.{module.name}'
        panel = getattr(importlib.import_module(name), 'PANEL', None)
        if not isinstance(panel, Panel):
            raise TypeError(f'{name}: declare PANEL, an instance of a class in porotwin_page.panel')
        found[module.name] = panel
    return dict(sorted(found.items(), key=lambda item: (item[1].order, item[0])))
