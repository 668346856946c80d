"""The diagnosis with other numbers: its package loaded afresh, with changed constants."""

import ast
import importlib
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any

from lab.budget import constants

PACKAGE = 'porotwin_diagnosis'
"""The package whose numbers are changed."""

DECIDING = ('data', 'decision', 'model', 'search', 'thresholds')
"""Its modules and folders that a verdict comes from; the others word, draw or advise."""

Changes = Mapping[str, str]
"""Values of constants, as Python, by their names."""


@dataclass(frozen=True)
class Number:
    """A constant that decides: its `module`, `name` and `value`."""

    module: str
    name: str
    value: Any


def deciding_numbers() -> list[Number]:
    """Return the constants of all modules that a verdict comes from."""
    package = importlib.import_module(PACKAGE)
    root = Path(str(package.__file__)).parent
    found = []
    for path in sorted(root.glob('**/*.py')):
        parts = path.relative_to(root).with_suffix('').parts
        if parts[0] not in DECIDING:
            continue
        module = '.'.join((PACKAGE, *parts))
        values = vars(importlib.import_module(module))
        tree = ast.parse(path.read_text(encoding='utf-8'))
        found += [Number(module, name, values[name]) for name in constants(tree)]
    return found


def load_afresh(changes: Changes) -> ModuleType:
    """Return the module `examine` of the package, loaded anew with the `changes`."""
    for name in [one for one in sys.modules if one.split('.')[0] == PACKAGE]:
        del sys.modules[name]
    finder = _Finder(changes)
    sys.meta_path.insert(0, finder)
    try:
        return importlib.import_module(f'{PACKAGE}.examine')
    finally:
        sys.meta_path.remove(finder)


class _Finder(MetaPathFinder):
    """Finds the modules of the package, and loads them with changes."""

    def __init__(self, changes: Changes) -> None:
        self._changes = changes

    def find_spec(self, name: str, path: Any, target: Any = None) -> ModuleSpec | None:
        """Return the spec of a module of the package; None for others."""
        if name.split('.')[0] != PACKAGE:
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = _Loader(self._changes, name, spec.loader.path)
        return spec


class _Loader(SourceFileLoader):
    """Loads a module whose constants change right after their definition."""

    def __init__(self, changes: Changes, name: str, path: str) -> None:
        super().__init__(name, path)
        self._changes = changes

    def get_code(self, _fullname: str) -> Any:
        """Return the code with the changes; none is kept on disk."""
        tree = ast.parse(self.get_data(self.path))
        body = list(_changed(tree.body, self._changes))
        return compile(ast.Module(body, []), self.path, 'exec', dont_inherit=True)


def _changed(body: list[ast.stmt], changes: Changes) -> Iterator[ast.stmt]:
    """Yield the statements, each definition of a constant with its change after it."""
    for node in body:
        yield node
        if isinstance(node, ast.Assign | ast.AnnAssign):
            for name in constants(ast.Module([node], []), numeric=False):
                if name in changes:
                    new = ast.parse(f'{name} = {changes[name]}').body[0]
                    yield ast.copy_location(ast.fix_missing_locations(new), node)
