"""Extension points: the modules in the folder of a package, and additions of other packages.

Another distribution adds to the folder `porotwin_solver.effects`, for example, by an entry point of
this group: `wedge = "my_package.wedge:EFFECT"`. examples/extension is one.
"""

import importlib
import importlib.util
import pkgutil
from collections.abc import Collection
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import TypeVar

from porotwin_core.basis.errors import InputError

T = TypeVar('T')


def module_names(package: str) -> list[str]:
    """Return the names of the modules in the folder of `package`, sorted, without importing them.

    Sub-packages and modules whose name begins with an underscore hold helpers and are left out.

    Raises:
        InputError: `package` does not exist or is a module.
    """
    spec = importlib.util.find_spec(package)
    if spec is None or spec.submodule_search_locations is None:
        raise InputError(f'{package}: not a package')
    return sorted(
        module.name
        for module in pkgutil.iter_modules(spec.submodule_search_locations)
        if not module.ispkg and not module.name.startswith('_')
    )


def extension_names(package: str) -> list[str]:
    """Return the names of what `discovered` finds in `package`, without importing any of it."""
    return [*module_names(package), *(one.name for one in installed(package))]


def discovered(
    package: str, attribute: str, kind: type[T], guide: str, *, helpers: Collection[str] = ()
) -> dict[str, T]:
    """Return the object `attribute` of every module in the folder of `package`, by name.

    Entry points of the group `package` follow. The order is that of the names. If the object has an
    attribute `name`, it is the name of the module, perhaps with dashes instead of underscores.
    Otherwise the module's name counts.

    Args:
        package: dotted name of the package.
        attribute: name of the object that every module defines.
        kind: class of these objects.
        guide: the document that explains how to write such a module.
        helpers: modules of the folder that define no such object.

    Raises:
        InputError: a module cannot be imported, does not define the object, defines it
            incompletely, gives it another name than its own, or the name of another one; one line
            that names the module, the fault and the guide.
    """
    found: dict[str, T] = {}
    places = [
        (name, f'{package}.{name}', f'{package}.{name}:{attribute}')
        for name in module_names(package)
        if name not in helpers
    ]
    places += [(one.name, f'{one.value} of {one.group}', one.value) for one in installed(package)]
    for name, where, place in places:
        if name in found:
            raise InputError(f'{where}: there is a {name} already; give it another name')
        value = loaded(place, where, guide)
        if not isinstance(value, kind):
            raise InputError(
                f'{where}: must define {attribute} = {kind.__name__}(...); see {guide}'
            )
        own_name = getattr(value, 'name', name)
        if str(own_name).replace('-', '_') != name:
            raise InputError(f'{where}: its {attribute} has the name {own_name!r}; see {guide}')
        found[own_name] = value
    return found


@cache
def installed(package: str) -> tuple[EntryPoint, ...]:
    """Return the entry points of other distributions for the extension point `package`."""
    return tuple(sorted(entry_points(group=package), key=lambda one: one.name))


def loaded(place: str, where: str, guide: str) -> object:
    """Return the object at `place`, MODULE:NAME or MODULE; None if the module lacks it.

    Raises:
        InputError: the module cannot be imported.
    """
    module, _, name = place.partition(':')
    try:
        found = importlib.import_module(module)
        return getattr(found, name, None) if name else found
    except InputError:
        raise
    except (Exception, SystemExit) as error:  # whatever is wrong in a new module: one line
        fault = ' '.join(f'{type(error).__name__}: {error}'.split())
        raise InputError(f'{where}: {fault}; see {guide}') from error
