"""Finds the panels of the page: every module in the folder `panels` declares one as PANEL."""

import functools

from porotwin_core.basis.discovery import discovered
from porotwin_page import panels
from porotwin_page.panel import Panel


@functools.cache
def all_panels() -> dict[str, Panel]:
    """Return all panels by the names of their modules, ordered by `order` and name.

    Raises:
        InputError: a module has no PANEL of a known kind.
    """
    found = discovered(panels.__name__, 'PANEL', Panel, 'docs/extend/panel.md')
    return dict(sorted(found.items(), key=lambda item: (item[1].order, item[0])))
