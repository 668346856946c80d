"""Write docs/verification.md, the problems of the field, from docs/figures/verification.csv.

python docs/make_verification.py             # the page from the table
python docs/make_verification.py --measure   # measures first, some minutes
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

`docs/make_verification.py` writes this page. [rigs/verification](../rigs/verification) describes
problems with a known answer on the scale of a laboratory. Run one:

```sh
./porotwin simulate rigs/verification/henry --output henry.nc --grid 100x50 --times 0:60000:3000
```

Nothing was fitted. `./porotwin bench verification` measures the errors; `--measure` puts them here.

| problem | answer | error | time | `simulate rigs/verification/` |
| --- | --- | --- | --- | --- |
{rows}

*map*, *injected*, *half withdrawn*: mean error over the mean. *toe*: negative if the wedge is too
short.

- **Henry.** Salt enters with the water of the sea only. Henry lets it diffuse as well against the
  water that leaves (*Henry*), which no key of `rig.yaml` describes.
- **Glover** holds for deep sand and a sharp interface. Here the sand is 20 cm deep and the scheme
  mixes.
- **The sand tank** is a real one. `seen.csv` holds the photographed wedges.
- **Left out**: the salt lake (Wooding 1997, Simmons 1999). Evaporation that leaves its salt behind
  cannot be described, and no published figure is at hand.
- **MODFLOW 6** did not run beside: no package index that we use offers the program.
"""


def rows(table: list[dict[str, str]]) -> list[str]:
    """Return a line of the page for each problem."""
    lines = []
    for problem in PROBLEMS:
        own = {line['figure']: line['value'] for line in table if line['what'] == problem.name}
        seconds = own.pop('time [s]')
        errors = '; '.join(_told(name, value) for name, value in own.items())
        lines.append(
            f'| {problem.title} | {problem.source} | {errors} | {float(seconds):.0f} s | '
            f'`{problem.words}` |'
        )
    return lines


def _told(name: str, value: str) -> str:
    what, _, unit = name.partition(' [')
    return f'{what} {value} {unit.rstrip("]")}'


def page() -> str:
    """Return the text of docs/verification.md."""
    with TABLE.open(encoding='utf-8', newline='') as file:
        table = list(csv.DictReader(file))
    return TEXT.format(rows='\n'.join(rows(table)))


def measure() -> None:
    """Measure all problems and write the table."""
    found = importlib.import_module('lab.benches.bench_verification').run()
    date = datetime.now(tz=UTC).date().isoformat()
    with TABLE.open('w', encoding='utf-8', newline='') as file:
        writer = csv.writer(file, lineterminator='\n')
        writer.writerow(COLUMNS)
        for row in found:
            words = (date, 'bench verification', '', '', *row.values(), '', '')
            writer.writerow(words)


if __name__ == '__main__':
    if '--check' in sys.argv:
        sys.exit(TARGET.read_text(encoding='utf-8') != page())
    if '--measure' in sys.argv:
        measure()
    TARGET.write_text(page(), encoding='utf-8')
