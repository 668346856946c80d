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
./porotwin simulate rigs/verification/henry --output henry.nc --grid 40x20 --times 0:60000:3000
```

`.venv/bin/python docs/make_verification.py --measure` measures anew. The time is that of the
whole problem.

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
- **MODFLOW 6**: mean difference of maps on cells twice as large, over their mean; a comparison with
  a peer. `flopy` writes its input from `rig.yaml`. It needs `pip install flopy`, and `mf6` in
  your PATH (`get-modflow :home`, not `:python`). Without them a figure stays, with its date.
"""


def rows(table: list[dict[str, str]]) -> list[str]:
    """Return a line of the page for each problem."""
    lines = []
    for problem in PROBLEMS:
        measured = [line for line in table if line['what'] == problem.name]
        own = {line['figure']: line['value'] for line in measured}
        seconds = own.pop('time [s]')
        errors = _told(own)
        if old := {line['date'] for line in measured} - {measured[-1]['date']}:
            errors += f' (of {max(old)}, without MODFLOW 6 since)'
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
    new = [[date, 'bench verification', '', '', *row.values(), '', ''] for row in found]
    measured = {tuple(row[4:6]) for row in new}
    anew = {row[4] for row in new}
    with TABLE.open(encoding='utf-8', newline='') as file:
        _, *old = csv.reader(file)
    kept = [row for row in old if row[4] not in anew or _is_kept(row, measured)]
    order = [problem.name for problem in PROBLEMS]
    with TABLE.open('w', encoding='utf-8', newline='') as file:
        writer = csv.writer(file, lineterminator='\n')
        writer.writerow(COLUMNS)
        writer.writerows(sorted([*kept, *new], key=lambda row: order.index(row[4])))


def _is_kept(row: list[str], measured: set[tuple[str, ...]]) -> bool:
    """Return whether an old row stays: the comparison with MODFLOW 6, where it is missing now."""
    return row[5].startswith('MODFLOW 6') and tuple(row[4:6]) not in measured


if __name__ == '__main__':
    if '--check' in sys.argv:
        sys.exit(TARGET.read_text(encoding='utf-8') != page())
    if '--measure' in sys.argv:
        measure(sys.argv[sys.argv.index('--measure') + 1 :])
    TARGET.write_text(page(), encoding='utf-8')
