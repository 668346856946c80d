"""./porotwin compare: two runs beside each other."""

import dataclasses
import math
import re
from pathlib import Path
from typing import Annotated, Any

import typer

from porotwin_cli.commands.runs import HASH_DIGITS, NOTHING
from porotwin_cli.terminal import Json, print_json, print_table
from porotwin_core.basis.units import MINUTE_S, percent

HASH = re.compile('[0-9a-f]{64}')


def command(
    first: Annotated[Path, typer.Argument(help='Bag or experiment folder.')],
    second: Annotated[Path, typer.Argument(help='The other one.')],
    as_json: Json = False,
) -> None:
    """Compare two runs: their rigs, rates, tracer, forecasts, and their maps at the same times.

    Example: ./porotwin compare runs/monday/bag runs/tuesday/bag
    """
    from porotwin_cli.recorded.run_comparison import compare_runs

    found = compare_runs(first, second)
    if as_json:
        print_json({'first': first, 'second': second, **dataclasses.asdict(found)})
        return
    one, other = found.figures
    names = dict.fromkeys([*one, *other])
    rows = [(name, _shown(one.get(name, '')), _shown(other.get(name, ''))) for name in names]
    told = [row for row in rows if any(cell != NOTHING for cell in row[1:])]
    print_table('two runs', ('', str(first), str(second)), told)
    print(f'rig.yaml differs in {", ".join(found.keys)}' if found.keys else 'the rigs are the same')
    if found.distances:
        last, worst = max(found.distances), max(found.distances, key=found.distances.__getitem__)
        print(
            f'maps with tracer at {len(found.distances)} common times differ by '
            f'{percent(found.distances[last], 1)} at the last, {last / MINUTE_S:.3g} min, and by '
            f'at most {percent(found.distances[worst], 1)} at {worst / MINUTE_S:.3g} min'
        )
    else:
        print('no maps with tracer of the same times and size')


def _shown(value: Any) -> str:
    """Return a figure in four digits, or a text; of a hash the first letters."""
    if isinstance(value, float):
        return NOTHING if math.isnan(value) else f'{value:.4g}'
    text = str(value)
    return (text[:HASH_DIGITS] if HASH.fullmatch(text) else text) or NOTHING
