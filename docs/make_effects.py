"""Write docs/effects.md, the table of all effects, from the registry.

python docs/make_effects.py
"""

import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

from porotwin_core.model.effect_parameter import Parameter
from porotwin_rig.effects import EFFECTS as RIG_EFFECTS
from porotwin_rig.effects.definition.registry import PACKAGE as RIG_PACKAGE
from porotwin_solver.effects import EFFECTS
from porotwin_solver.effects.definition.effect import Effect, Scope
from porotwin_solver.effects.definition.registry import PACKAGE

TARGET = Path(__file__).with_name('effects.md')

HEAD = """# Effects and their parameters

Causes of a gap between model and rig, with parameters and a check in the laboratory.
`docs/make_effects.py` writes this page.

The list `effects` in [rig.yaml](rig.md) describes those of your rig.
`./porotwin simulate ... --effect NAME:PARAM=VALUE,...` simulates one, [`diagnose`](diagnosis.md)
finds one, and [one file](extend/effect.md) adds one.

Symbols: c is the concentration of the mobile water, v the pore velocity [m/s], t the time since the
start of the recording [s], x the distance from the left side and z the height [m], W the width of
the rig [m]. An effect with `since` acts from that time on, its onset.

With this block in `rig.yaml` a pump delivers 8 % too little, and a leak loses 10 ml/h. The well and
the place are those of your rig, here of [`rigs/small`](../rigs/small/rig.yaml).

```yaml
effects:
  - name: rate
    parameters: {well: injector, factor: 0.92, since: 0}
  - name: leak
    parameters: {x: 0.5, z: 0.2, rate: -10.0}    # m, m, ml/h; a negative rate is a loss
```

`./porotwin check` draws the place of the leak.
"""

OUTSIDE = """
## Effects of the virtual rig only

The diagnosis does not know these effects. The blind check tests with them whether it admits that it
has no explanation. Python makes recordings with them
([example](../examples/virtual_rig_photograph.py)).

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
    tables = ''.join(f'\n## {title}\n\n{_table(scope)}' for scope, title in TITLES.items())
    return HEAD + tables + OUTSIDE + _outside()


def _table(scope: Scope) -> str:
    effects = [effect for effect in EFFECTS.values() if effect.scope is scope]
    return _rows(['name', 'effect', 'parameters', 'check'], map(_row, effects))


def _outside() -> str:
    rows = (
        [f'`{name}`', _text(RIG_PACKAGE, name), _parameters(effect.parameters)]
        for name, effect in RIG_EFFECTS.items()
        if name not in EFFECTS
    )
    return _rows(['name', 'effect', 'parameters'], rows)


def _row(effect: Effect) -> list[str]:
    text, parameters = _text(PACKAGE, effect.name), _parameters(effect.parameters)
    return [f'`{effect.name}`', text, parameters, effect.laboratory_check]


def _text(package: str, name: str) -> str:
    """Return the docstring of the module `name` on one line."""
    return ' '.join((sys.modules[f'{package}.{name}'].__doc__ or '').split())


def _parameters(parameters: Mapping[str, Parameter]) -> str:
    return '<br>'.join(f'`{name}` {_range(parameter)}' for name, parameter in parameters.items())


def _range(parameter: Parameter) -> str:
    """Return unit, range and default of `parameter`."""
    parts = [f'[{parameter.unit}]']
    if parameter.above > -float('inf'):
        parts.append(f'> {parameter.above:g}')
    bounded = parameter.low > -float('inf'), parameter.high < float('inf')
    if all(bounded):
        parts.append(f'{parameter.low:g}…{parameter.high:g}')
    elif bounded[0]:
        parts.append(f'≥ {parameter.low:g}')
    elif bounded[1]:
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
