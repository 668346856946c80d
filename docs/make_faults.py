"""Write docs/faults.md: the faults of the fault suite, and the documented state of each.

    python docs/make_faults.py            # writes docs/faults.md
    python docs/make_faults.py --check    # exit status 1 if docs/faults.md is out of date

The table comes from tests/faults; ./porotwin test injects each of its faults into a running twin.
"""

import sys
from collections.abc import Iterable, Iterator
from itertools import groupby
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / 'docs' / 'faults.md'
sys.path[:0] = [str(ROOT / 'tests'), str(ROOT / 'tests' / 'fixtures')]

from faults.fault import Fault, all_faults  # noqa: E402  the folder of tests is no package
from faults.stage import CYCLES, PHOTO_INTERVAL_S  # noqa: E402

from porotwin_core.basis.units import percent  # noqa: E402
from porotwin_hub.estimation.pump_watch import (  # noqa: E402
    MOST_SHARE,
    TESTS_IN_TURN,
    WATCH_S,
)
from porotwin_hub.models.plant_knowledge import DEAD_SHARE  # noqa: E402

HEAD = f"""\
# Faults

This page is for the person beside a rig: the tested faults, their signs, the reaction of the twin,
and the remedy. `./porotwin test` starts a twin, injects one fault after the other, and checks each
sign.

The signs name their place:

| sign | place |
| --- | --- |
| `/diagnostics: NODE` | the panel *Nodes* of the [page](page.md) |
| `hub/cycle` | the lines below the maps of the page |
| log of NODE | the file `log/NODE.log` in the folder of the run, under `runs/` |
| `up` prints | the terminal of `./porotwin up` |

These rules hold for every fault:

- A fault shows within {CYCLES} cycles of {PHOTO_INTERVAL_S:g} s; a weak pump takes longer.
- After the remedy the twin sets rates again within {CYCLES} cycles.
- No state follows from a bad photograph, no setpoint from a bad photograph or message.
- Every setpoint keeps the limits of `rig.yaml`.

`./porotwin bench faults` is the long test. `./porotwin bench fuzz` damages files and sends random
words.
"""

TABLE = ('| fault | sign | reaction of the twin | remedy |', '| --- | --- | --- | --- |')

PUMPS = (
    (
        f'A pump without a meter delivers at most {percent(MOST_SHARE)} of its rate.',
        'hub/cycle: "seems to deliver about", with its well',
        f'Tells it after {TESTS_IN_TURN} tests in turn, one each {WATCH_S:g} s. States and plans '
        'use the share ([control.md](control.md#a-pump-that-stops-without-a-meter)).',
        'check pump and tube',
    ),
    (
        f'It stops, or delivers less than {percent(DEAD_SHARE)}.',
        'hub/cycle: "seems to deliver nothing", with its well',
        'The same. The plan goes on without it.',
        'mend it: two photographs take the belief back',
    ),
    (
        'The photographs hold less tracer than the meters tell.',
        'hub/cycle: "does the pump of", with the wells of tracer; `up` prints it',
        'Tells the volumes. Control continues.',
        'weigh the stock',
    ),
)
"""Faults that take minutes of photographs; the tests of the hub inject them."""


def rows(faults: Iterable[Fault]) -> Iterator[str]:
    """Yield the rows of the faults; those with the same reaction and remedy share a row."""
    alike: dict[tuple[str, str], list[Fault]] = {}
    for fault in faults:
        alike.setdefault((fault.does, fault.mends), []).append(fault)
    for (does, mends), members in alike.items():
        injected = '<br>'.join(fault.injected for fault in members)
        signs = [_signs(fault) for fault in members]
        shown = '<br>'.join(signs if len(set(signs)) > 1 else signs[:1])
        yield f'| {injected} | {shown} | {does} | {mends} |'


def _signs(fault: Fault) -> str:
    return '; '.join(_cell(str(sign)) for sign in fault.signs) or 'does not show'


def _cell(text: str) -> str:
    return text.replace('|', '\\|')


def page() -> str:
    """Return the whole document."""
    pumps = ['## Pumps\n', *TABLE, *(f'| {" | ".join(row)} |' for row in PUMPS), '']
    parts = [HEAD, '\n'.join(pumps)]
    for group, faults in groupby(all_faults(), key=lambda fault: fault.group):
        parts.append(
            '\n'.join(
                [
                    f'## {group}\n',
                    *TABLE,
                    *rows(faults),
                    '',
                ]
            )
        )
    return '\n'.join(parts)


def main() -> int:
    """Write the page, or with --check compare it with the file."""
    text = page()
    if '--check' in sys.argv[1:]:
        return int(PAGE.read_text(encoding='utf-8') != text)
    PAGE.write_text(text, encoding='utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main())
