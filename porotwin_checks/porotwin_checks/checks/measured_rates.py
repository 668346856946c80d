"""Do the measured rates cover the commanded ones, and are they alike?"""

import itertools
from collections.abc import Iterable, Iterator

import numpy as np

from porotwin_checks.known import Known
from porotwin_core.basis.check import Check
from porotwin_core.basis.plausibility import CONVERTED
from porotwin_core.basis.remark import Remark
from porotwin_core.basis.units import MINUTE_S
from porotwin_core.rates.wells import Schedule, WellRate, later_commands, quoted

MOST_RATIO = 3.0
"""Measured over commanded rates that is odd: worn pumps deliver half of what they should."""

LATER = 'add the later lines; until then the commanded rates count'


def _find(known: Known) -> Iterator[Remark]:
    """Yield the remarks about measured rates that are incomplete or far from commanded ones."""
    assert known.commanded is not None and known.measured is not None
    name, rows = 'rates_measured.csv', known.measured.rows
    measured, end = {row.well for row in rows}, rows[-1].time
    missing = sorted(
        {row.well for row in known.commanded.rows if row.rate.rate and row.well not in measured}
    )
    if missing:
        why = f'these wells pump by rates.csv, but have no measured rates: {quoted(missing)}'
        yield Remark(name, '', why, 'the commanded rates count there', code='unmeasured_wells')
    later = [row for row in later_commands(known.commanded, known.measured) if row.well in measured]
    if later:
        changed = f"well '{later[0].well}' at {later[0].time:g} s"
        why = f'it ends at {end:g} s, and rates.csv changes {changed}'
        yield Remark(name, '', why, LATER, code='measured_rates_end')
    stopped = known.commanded.rows[-1].time
    goes_on = any(rate.rate for rate in known.commanded.at(stopped).values())
    if rows[0].time > max(stopped, 0.0) and not goes_on:
        why = f'it begins at {rows[0].time:g} s, after the last row of rates.csv at {stopped:g} s'
        yield Remark(name, '', why, 'compare the dates and clocks of both', code='other_clock')
    yield from _other_fluid(known.commanded, known.measured, name)
    ratios_of_wells = list(_ratios(known.commanded, known.measured))
    turned = _turned(ratios_of_wells)
    if turned:
        why = f'the rates of {quoted(turned)} have the other sign in rates.csv'
        remedy = 'write produced water with a minus in both'
        yield Remark(name, '', why, remedy, code='other_sign')
    ratios = [abs(ratio) for _, ratio in ratios_of_wells]
    ratio = float(np.median(ratios)) if ratios else 1.0
    if not 1.0 / MOST_RATIO < ratio < MOST_RATIO:
        per_minute = CONVERTED[0] < ratio * MINUTE_S < CONVERTED[1]
        unit = 'were they in ml/min? write ml/h' if per_minute else 'compare both files'
        why = f'its rates are {ratio:.3g} times those of rates.csv'
        yield Remark(name, '', why, unit, code='other_unit')


def _other_fluid(commanded: Schedule, measured: Schedule, name: str) -> Iterator[Remark]:
    """Yield a remark for the first well that injects another fluid than commanded."""
    asked: dict[str, WellRate] = {}
    found: dict[str, WellRate] = {}
    rows = [(row.time, 0, row) for row in commanded.rows if row.time < measured.rows[-1].time]
    rows += [(row.time, 1, row) for row in measured.rows]
    both = itertools.groupby(sorted(rows, key=lambda item: item[:2]), key=lambda item: item[0])
    for time, changes in both:
        for _, is_measured, row in changes:
            (found if is_measured else asked)[row.well] = row.rate
        for well, rate in found.items():
            own = asked.get(well, WellRate())
            if min(rate.rate, own.rate) > 0.0 and own.concentration != rate.concentration:
                yield Remark(
                    f"{name}: concentration of well '{well}' at {time:g} s",
                    f'{rate.concentration:g}',
                    f'rates.csv says {own.concentration:g}',
                    'write the injected one; a change of the fluid needs its own row',
                    code='other_fluid',
                )
                return


def wells_with_turned_sign(commanded: Schedule, measured: Schedule) -> list[str]:
    """Return the wells, sorted, whose measured rates have the other sign than the commanded ones.

    Half of the measured rows of a well or more must have it: one may belong to a reversed pump.
    """
    return _turned(_ratios(commanded, measured))


def _turned(ratios: Iterable[tuple[str, float]]) -> list[str]:
    signs: dict[str, list[bool]] = {}
    for well, ratio in ratios:
        signs.setdefault(well, []).append(ratio < 0.0)
    return sorted(well for well, turned in signs.items() if 2 * sum(turned) >= len(turned))


def _ratios(commanded: Schedule, measured: Schedule) -> Iterator[tuple[str, float]]:
    """Yield wells with measured over commanded rates, at the rows of wells that shall pump."""
    for row in measured.rows:
        asked = commanded.at(row.time).get(row.well)
        if asked is not None and asked.rate and row.rate.rate:
            yield row.well, row.rate.rate / asked.rate


CHECK = Check(needs=('commanded', 'measured'), find=_find)
