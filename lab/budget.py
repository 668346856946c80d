"""The budget of the project: numbers that decide, lines and lengths, beside the last agreed ones.

    python -m lab.budget [--json]

A number that decides is a constant of a module, or the default of a class attribute, in an
installed package. `budget.toml` holds the agreed figures. A test fails above them, so that a new
rule replaces an old one. Whoever lowers a figure lowers the agreed one with it.
"""

import argparse
import ast
import re
import statistics
import sys
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from porotwin_cli.terminal import print_json, print_table
from porotwin_cli.workspace import ROOT

AGREED = Path(__file__).with_name('budget.toml')
"""The agreed figures, and the wanted ones."""

FOLDERS = ('porotwin_*', 'lab', 'tests')
"""Folders with Python of the project."""

Function = ast.FunctionDef | ast.AsyncFunctionDef

CONSTANT = re.compile(r'_?[A-Z]')
"""Begin of the name of a constant."""


@dataclass(frozen=True)
class Budget:
    """The figures of a checkout.

    Attributes:
        numbers: constants of modules and defaults of class attributes in installed packages.
        function_defaults: numeric defaults of parameters there.
        product_lines: lines of all Python files that are no tests, the laboratory included.
        installed_lines: lines of the packages without the laboratory.
        test_lines: lines of all Python tests.
        median_file: median lines of an installed module.
        median_function: median lines of a function there.
    """

    numbers: int
    function_defaults: int
    product_lines: int
    installed_lines: int
    test_lines: int
    median_file: float
    median_function: float


def measure(root: Path = ROOT) -> Budget:
    """Return the figures of the checkout `root`."""
    ours = [path for folder in FOLDERS for path in _files(root, folder)]
    tests = [path for path in ours if _is_test(path, root)]
    laboratory = [path for path in _files(root, 'lab') if not _is_test(path, root)]
    installed = [path for path in _files(root, 'porotwin_*') if not _is_test(path, root)]
    trees = [ast.parse(path.read_text(encoding='utf-8')) for path in installed]
    functions = [node for tree in trees for node in _functions(tree.body)]
    lines = _lines(installed)
    return Budget(
        numbers=sum(map(_numbers, trees)),
        function_defaults=sum(map(_defaults, functions)),
        product_lines=sum(lines) + sum(_lines(laboratory)),
        installed_lines=sum(lines),
        test_lines=sum(_lines(tests)),
        median_file=statistics.median(lines or [0]),
        median_function=statistics.median([_length(node) for node in functions] or [0]),
    )


def _functions(statements: Sequence[ast.AST]) -> Iterator[Function]:
    """Yield the functions among `statements` and within them; expressions hold none."""
    for node in statements:
        if isinstance(node, Function):
            yield node
        for part in ('body', 'orelse', 'finalbody', 'handlers', 'cases'):
            yield from _functions(getattr(node, part, ()))


def _files(root: Path, folder: str) -> Iterator[Path]:
    found = sorted(root.glob(f'{folder}/**/*.py'))
    return (path for path in found if 'build' not in path.relative_to(root).parts)


def _is_test(path: Path, root: Path) -> bool:
    return not {'test', 'tests'}.isdisjoint(path.relative_to(root).parts)


def _lines(paths: list[Path]) -> list[int]:
    return [path.read_text(encoding='utf-8').count('\n') for path in paths]


def _length(node: Function) -> int:
    return (node.end_lineno or node.lineno) - node.lineno + 1


def _is_number(node: ast.expr) -> bool:
    """Return whether an expression is a number, or a sum or list with one."""
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int | float) and not isinstance(node.value, bool)
    if isinstance(node, ast.UnaryOp):
        return _is_number(node.operand)
    if isinstance(node, ast.BinOp):
        return _is_number(node.left) or _is_number(node.right)
    return isinstance(node, ast.Tuple | ast.List) and any(map(_is_number, node.elts))


def _numbers(module: ast.Module) -> int:
    """Return the number of constants and defaults of class attributes in a module."""
    count = len(constants(module))
    for node in module.body:
        if isinstance(node, ast.ClassDef):
            values = [item.value for item in node.body if isinstance(item, ast.AnnAssign)]
            count += sum(value is not None and _is_number(value) for value in values)
    return count


def constants(module: ast.Module, *, numeric: bool = True) -> list[str]:
    """Return the names of the constants of a module; with `numeric` those that are numbers."""
    found: list[str] = []
    for node in module.body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            named = [part for target in targets for part in _parts(target)]
            names = [part.id for part in named if isinstance(part, ast.Name)]
            if (_is_number(node.value) or not numeric) and all(map(CONSTANT.match, names)):
                found += names
    return found


def _parts(target: ast.expr) -> list[ast.expr]:
    return target.elts if isinstance(target, ast.Tuple) else [target]


def _defaults(node: Function) -> int:
    """Return the number of parameters of a function whose default is a number."""
    return sum(map(_is_number, filter(None, (*node.args.defaults, *node.args.kw_defaults))))


def read_agreed() -> dict[str, dict[str, float]]:
    """Return the `agreed` and the `wanted` figures by their names in `Budget`."""
    return tomllib.loads(AGREED.read_text(encoding='utf-8'))


def excesses(found: Budget, agreed: dict[str, float]) -> list[str]:
    """Return a line for each figure above the agreed one."""
    return [
        f'{name}: {value:g}, above the agreed {agreed[name]:g}; a new one replaces an old one'
        for name, value in asdict(found).items()
        if value > agreed[name]
    ]


def main() -> int:
    """Print the figures; return 1 if one is above the agreed one."""
    parser = argparse.ArgumentParser(prog='python -m lab.budget', description=measure.__doc__)
    parser.add_argument('--json', action='store_true', help='print one JSON object')
    as_json = parser.parse_args().json
    found, limits = measure(), read_agreed()
    rows: list[dict[str, Any]] = [
        {
            'figure': name,
            'now': value,
            'agreed': limits['agreed'][name],
            'wanted': limits['wanted'].get(name),
        }
        for name, value in asdict(found).items()
    ]
    if as_json:
        print_json({row.pop('figure'): row for row in rows})
    else:
        table = [[('' if cell is None else cell) for cell in row.values()] for row in rows]
        print_table('budget', list(rows[0]), table)
    above = excesses(found, limits['agreed'])
    for line in above:
        print(line, file=sys.stderr)
    return int(bool(above))


if __name__ == '__main__':
    sys.exit(main())
