"""Write docs/effects.md, the table of all effects, from the registry.

python docs/make_effects.py
"""

import sys
from collections.abc import Iterable
from pathlib import Path

from porotwin_core.effect_parameter import Parameter
from porotwin_solver.effects import EFFECTS
from porotwin_solver.effects.definition.effect import Effect, Scope
from porotwin_solver.effects.definition.registry import PACKAGE

TARGET = Path(__file__).with_name('effects.md')

HEAD = """# Effects and their parameters

An effect is a cause of a gap between the model and the rig. `rig.yaml` lists effects under
`effects`, `./porotwin simulate --effect NAME:PARAM=VALUE,...` switches one on, and
`./porotwin diagnose` finds them. Each effect is one file in
[`porotwin_solver/effects`](../porotwin_solver/porotwin_solver/effects);
[extend/effect.md](extend/effect.md) shows how to add one.

c is the concentration of the mobile water, v the pore velocity, t the time since the start of the
recording, x the distance from the left side, z the height, W the width of the rig.

This page is written by `docs/make_effects.py`.
"""

TITLES = {
    Scope.MODEL: 'The model',
    Scope.RIG: 'The whole rig',
    Scope.WELL: 'One well',
    Scope.PLACE: 'A place in the rig',
    Scope.CAMERA: 'The camera',
}


def page() -> str:
    """Return the text of docs/effects.md."""
    return HEAD + ''.join(f'\n## {title}\n\n{_table(scope)}' for scope, title in TITLES.items())


def _table(scope: Scope) -> str:
    effects = [effect for effect in EFFECTS.values() if effect.scope is scope]
    return _rows(['name', 'effect', 'parameters', 'check'], map(_row, effects))


def _row(effect: Effect) -> list[str]:
    text = (sys.modules[f'{PACKAGE}.{effect.name}'].__doc__ or '').strip()
    parameters = '<br>'.join(f'`{name}` {_range(p)}' for name, p in effect.parameters.items())
    return [f'`{effect.name}`', ' '.join(text.split()), parameters, effect.laboratory_check]


def _range(parameter: Parameter) -> str:
    """Return unit, range and default of `parameter`."""
    parts = [f'[{parameter.unit}]']
    if parameter.above > -float('inf'):
        parts.append(f'> {parameter.above:g}')
    if parameter.low > -float('inf'):
        parts.append(f'≥ {parameter.low:g}')
    if parameter.high < float('inf'):
        parts.append(f'≤ {parameter.high:g}')
    if parameter.default is not None:
        parts.append(f'default {parameter.default:g}')
    return ', '.join(parts)


def _rows(head: list[str], rows: Iterable[list[str]]) -> str:
    cells = [[cell.replace('|', r'\|') for cell in row] for row in rows]
    lines = [head, ['---'] * len(head), *cells]
    return ''.join(f'| {" | ".join(line)} |\n' for line in lines)


if __name__ == '__main__':
    TARGET.write_text(page(), encoding='utf-8')
