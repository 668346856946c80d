"""Do the commanded rates pump a well through a pause that rig.yaml announces?"""

from collections.abc import Iterator

from porotwin_checks.known import Known
from porotwin_core.basis.check import Check
from porotwin_core.basis.remark import Remark
from porotwin_core.basis.units import MINUTE_S, ML
from porotwin_core.rates.fixed_pauses import FixedPauses
from porotwin_core.rates.wells import Schedule, WellRate

RESTS = (
    '{well} pumps from {begin_min:g} to {end_min:g} min, where control.fixed of rig.yaml lets it '
    'rest, and so it rests: {run_ml:.4g} ml instead of {told_ml:.4g}; correct one of the two files'
)


def _find(known: Known) -> Iterator[Remark]:
    told = known.commanded
    assert told is not None
    pauses = FixedPauses.of(known.rig)
    run = pauses.in_schedule(told)
    last = known.end
    for well, own in pauses.of_wells.items():
        for begin, end in own:
            if begin < last and _pumps_throughout(told, well, begin, min(end, last)):
                yield Remark.of(
                    'rates.csv',
                    'pumps_in_pause',
                    RESTS,
                    well=well,
                    begin_min=begin / MINUTE_S,
                    end_min=min(end, last) / MINUTE_S,
                    run_ml=_volume(run, well, last) * ML,
                    told_ml=_volume(told, well, last) * ML,
                )
                break


def _pumps_throughout(rates: Schedule, well: str, begin: float, end: float) -> bool:
    return all(held.get(well, WellRate()).rate != 0.0 for _, _, held in rates.intervals(begin, end))


def _volume(rates: Schedule, well: str, end: float) -> float:
    """Return what the `well` injects until `end` [s], or takes out, [m^3]."""
    return sum(
        (high - low) * abs(held.get(well, WellRate()).rate)
        for low, high, held in rates.intervals(0.0, end)
    )


CHECK = Check(needs=('commanded',), find=_find)
