"""Does a pump deliver these rates, and does the rig stand them?"""

from collections.abc import Iterator
from dataclasses import replace

from porotwin_checks.known import Known
from porotwin_core.basis.check import Check
from porotwin_core.basis.plausibility import plausible_rate_ml_h, rate_remark
from porotwin_core.basis.remark import Remark
from porotwin_core.basis.units import to_ml_h
from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_core.rig import Rig


def _find(known: Known) -> Iterator[Remark]:
    for rates, name in ((known.commanded, 'rates.csv'), (known.measured, 'rates_measured.csv')):
        if rates is not None:
            yield from remarks_about_rates(rates, known.rig, name)


def remarks_about_rates(schedule: Schedule, rig: Rig, name: str = 'rates.csv') -> list[Remark]:
    """Return the remarks about rates that no pump delivers or no rig stands, one for each well.

    Args:
        schedule: the rates [m^3/s].
        rig: its pore volume says which rates are plausible.
        name: the file, for the remarks.
    """
    pores = rig.pore_volume
    least = plausible_rate_ml_h(pores)[0]
    found: dict[str, Remark] = {}
    rates = [abs(to_ml_h(row.rate.rate)) for row in schedule.rows]
    hopeless = 0.0 < max(rates, default=0.0) < least
    for row in schedule.rows:
        remark = rate_remark(f'{name}: well {row.well}', to_ml_h(row.rate.rate), pores)
        if remark is not None:
            found.setdefault(
                row.well, replace(remark, refused=remark.refused or hopeless, code='odd_rate')
            )
    return [*found.values(), *_contradictions(schedule, name)]


def _contradictions(schedule: Schedule, name: str) -> Iterator[Remark]:
    """Yield a remark for the first well that has two different rates at one time."""
    seen: dict[tuple[float, str], WellRate] = {}
    for row in schedule.rows:
        if seen.setdefault((row.time, row.well), row.rate) != row.rate:
            yield Remark(
                f'{name}: well {row.well}',
                f'{to_ml_h(row.rate.rate):g} ml/h',
                f'it has another rate at the same time of {row.time:g} s',
                'keep one row; the last one counts',
                code='two_rates',
            )
            return


CHECK = Check(find=_find)
