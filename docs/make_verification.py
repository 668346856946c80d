"""Write docs/verification.md, the problems of the field, from docs/figures/verification.csv.

python docs/make_verification.py             # the page from the table
python docs/make_verification.py --measure [NAME ...]  # measures first, all or these
python docs/make_verification.py --check     # fails if the page is old
"""

import csv
import importlib
import sys
from datetime import UTC, datetime
from pathlib import Path

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS.parent))

PROBLEMS = importlib.import_module('lab.verification.problems').PROBLEMS
TARGET = DOCS / 'verification.md'
TABLE = DOCS / 'figures' / 'verification.csv'
COLUMNS = ('date', 'command', 'seed', 'cases', 'what', 'figure', 'value', 'wanted', 'page')

TEXT = """\
# Problems that the field knows

[rigs/verification](../rigs/verification) holds problems with a known answer. Nothing was fitted.

```sh
./porotwin simulate rigs/verification/henry --output henry.nc --grid 50x25 --times 0:60000:3000
```

`docs/make_verification.py --measure` measures anew.

| problem | answer | error | time | `simulate rigs/verification/` |
| --- | --- | --- | --- | --- |
{rows}

*map*: mean error over the mean. *toe*: negative if the wedge is too short.

- **Henry.** His equations, solved by collocation. Salt enters with the water of the sea only. In
  the second ones it also diffuses, as Henry has it (`diffuses: true`), on cells of 10 cm.
- **Glover** holds for deep sand without mixing; here it is 20 cm deep, and the scheme mixes.
- **Photographed wedges**: SS-1, SS-2 and SS-3 of a real tank.
- **Salt lake**: water evaporates at the top left, and salt diffuses from there; the numbers are
  those of `ex-gwt-saltlake` of MODFLOW 6 (Simmons 1999).
- **MODFLOW 6**: mean difference of maps on cells twice as large, over their mean. `flopy`
  writes its input from `rig.yaml`. It needs `pip install flopy`, and `mf6` in the path.
"""


def rows(table: list[dict[str, str]]) -> list[str]:
    """Return a line of the page for each problem."""
    lines = []
    for problem in PROBLEMS:
        own = {line['figure']: line['value'] for line in table if line['what'] == problem.name}
        seconds = own.pop('time [s]')
        errors = _told(own)
        lines.append(
            f'| {problem.title} | {problem.source} | {errors} | {float(seconds):.0f} s | '
            f'`{problem.words}` |'
        )
    return lines


def _told(errors: dict[str, str]) -> str:
    """Return the errors, grouped by kind."""
    kinds: dict[tuple[str, str], list[str]] = {}
    for name, value in errors.items():
        what, _, unit = name.rstrip(']').partition(' [')
        kinds.setdefault((what.partition(', ')[0], unit), []).append(f'{float(value):g}')
    parts = (f'{what} {", ".join(values)} {unit}' for (what, unit), values in kinds.items())
    return '; '.join(part.strip() for part in parts)


def page() -> str:
    """Return the text of docs/verification.md."""
    with TABLE.open(encoding='utf-8', newline='') as file:
        table = list(csv.DictReader(file))
    return TEXT.format(rows='\n'.join(rows(table)))


def measure(names: list[str]) -> None:
    """Measure the problems of these names, or all, and write the table."""
    found = importlib.import_module('lab.benches.bench_verification').run(names)
    date = datetime.now(tz=UTC).date().isoformat()
    with TABLE.open(encoding='utf-8', newline='') as file:
        kept = [row for row in csv.reader(file) if names and row[4] not in {*names, 'what'}]
    with TABLE.open('w', encoding='utf-8', newline='') as file:
        writer = csv.writer(file, lineterminator='\n')
        writer.writerow(COLUMNS)
        for row in found:
            words = (date, 'bench verification', '', '', *row.values(), '', '')
            kept.append([*words])
        order = [problem.name for problem in PROBLEMS]
        writer.writerows(sorted(kept, key=lambda row: order.index(row[4])))


if __name__ == '__main__':
    if '--check' in sys.argv:
        sys.exit(TARGET.read_text(encoding='utf-8') != page())
    if '--measure' in sys.argv:
        measure(sys.argv[sys.argv.index('--measure') + 1 :])
    TARGET.write_text(page(), encoding='utf-8')
