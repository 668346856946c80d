"""Write docs/reliability.md, one screen of measured figures, from the tables in docs/figures.

    python docs/make_reliability.py

Each table is a CSV file with the columns COLUMNS, one figure a line. The page shows the lines with
`yes` in the column `page`; lines of one subject stand together.
"""

import csv
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

import jinja2

DOCS = Path(__file__).resolve().parent
TARGET = DOCS / 'reliability.md'
FIGURES = DOCS / 'figures'
COLUMNS = ('date', 'command', 'seed', 'cases', 'what', 'figure', 'value', 'wanted', 'page')

TEMPLATE = """\
# What was measured

`docs/make_reliability.py` writes this page from the tables in [figures](figures). They hold every
figure, good and bad, with its date, command, seed and number of cases. Single verdicts are in
[cases.json](figures/cases.json). Repeat a command to measure anew, and change the table.

In the cases of the diagnosis an effect is hidden from it. *Right*: the verdict names the true
effect, or one that makes the same maps within 2 %, or says *none* or *unexplained* where that is
true. *Sure*: a confidence of 0.8 or more. *By chance*: the error that true confidences would show.

| subject | cases | measured | wanted | date |
| --- | --- | --- | --- | --- |
{% for subject in subjects -%}
| [{{ subject.table }}](figures/{{ subject.table }}.csv): {{ subject.what }} | {{ subject.cases }} |
{#- #} {{ subject.measured }} | {{ subject.wanted }} | {{ subject.date }} |
{% endfor %}
What to expect at a rig: of diagnoses from maps 19 of 20 are right, from photographs 16 of 20. Wrong
ones are mostly *unexplained*, or not sure. Below 1.5 noise floors a verdict is a guess, and its
confidence says so.
"""


def figures(path: Path) -> list[dict[str, str]]:
    """Return the lines of a table of figures.

    Raises:
        ValueError: the table has other columns than COLUMNS, or a line without figure or value.
    """
    with path.open(encoding='utf-8', newline='') as file:
        reader = csv.DictReader(file, strict=True)
        if tuple(reader.fieldnames or ()) != COLUMNS:
            raise ValueError(f'{path.name}: columns {reader.fieldnames}, not {COLUMNS}')
        lines = list(reader)
    for number, line in enumerate(lines, 2):
        if None in line or not (line['date'] and line['what'] and line['figure'] and line['value']):
            raise ValueError(f'{path.name}, line {number}: needs date, what, figure and value')
    return lines


def subjects() -> Iterator[dict[str, str]]:
    """Yield the rows of the page: the marked figures of one subject of a table."""
    for path in sorted(FIGURES.glob('*.csv')):
        marked = [line for line in figures(path) if line['page'] == 'yes']
        for what, group in groupby(marked, key=lambda line: line['what']):
            lines = list(group)
            yield {
                'table': path.stem,
                'what': what,
                'cases': lines[0]['cases'],
                'measured': '; '.join(_measured(line) for line in lines),
                'wanted': '; '.join(line['wanted'] for line in lines if line['wanted']),
                'date': max(line['date'] for line in lines),
            }


def _measured(line: dict[str, str]) -> str:
    return line['value'] if line['figure'] == 'value' else f'{line["figure"]}: {line["value"]}'


def page() -> str:
    """Return the text of docs/reliability.md."""
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, keep_trailing_newline=True, autoescape=False
    )
    return environment.from_string(TEMPLATE).render(subjects=list(subjects()))


if __name__ == '__main__':
    TARGET.write_text(page(), encoding='utf-8')
