"""Do the commanded rates tell the whole experiment: the producer too, and until when?"""

from collections.abc import Iterator

from porotwin_checks.known import Known
from porotwin_core.basis.check import Check
from porotwin_core.basis.plausibility import extent_remark
from porotwin_core.basis.remark import Remark
from porotwin_core.basis.units import MINUTE_S
from porotwin_core.rates.wells import quoted

AFTER_END = (
    'its last change is at {last_min:.4g} min, and the experiment ends at {end_min:g} min, so that '
    'it never happens; correct control.end_min of rig.yaml, or the rows'
)


def _find(known: Known) -> Iterator[Remark]:
    yield from _idle_producer(known)
    yield from _end(known)
    yield from _extent(known)


def _idle_producer(known: Known) -> Iterator[Remark]:
    """Yield a remark if wells inject, and the producer has no row."""
    control = known.rig.control
    if control is None or control.producer is None or known.commanded is None:
        return
    rows = known.commanded.rows + (known.measured.rows if known.measured else ())
    injects = any(row.rate.rate > 0.0 for row in rows)
    if injects and all(row.well != control.producer for row in rows):
        why = (
            f"no row is of control.producer '{control.producer}', so that it counts as standing "
            'still while other wells inject'
        )
        yield Remark(
            'rates.csv',
            '',
            why,
            'add its rates, with a minus, or a row of 0 at 0 s',
            code='idle_producer',
        )


def _end(known: Known) -> Iterator[Remark]:
    """Yield a remark if nothing says how long the experiment lasts."""
    if known.commanded is None or known.has('times') or known.photos:
        return
    last = max((row.time for row in known.commanded.rows), default=0.0)
    pumping = sorted(well for well, rate in known.commanded.at(last).items() if rate.rate)
    if last <= 0.0 or pumping:
        why = f'its last rows let {quoted(pumping)} pump, and nothing says until when'
        if last <= 0.0:
            why = 'all its rows are at the start, so that nothing says when the experiment ends'
        yield Remark(
            'rates.csv', '', why, 'end with rows of rate 0 at the last time', code='no_end'
        )


def _extent(known: Known) -> Iterator[Remark]:
    """Yield a remark if a plan does not suit the time of the experiment."""
    end_min = known.rig.control.end_min if known.rig.control is not None else None
    if known.commanded is None or end_min is None or known.has('times') or known.photos:
        return
    last_min = known.commanded.rows[-1].time / MINUTE_S
    odd = extent_remark('rates.csv', last_min, end_min, 'seconds')
    if odd:
        yield odd
    elif last_min > end_min:
        facts = {'last_min': last_min, 'end_min': end_min}
        yield Remark.of('rates.csv', 'rows_after_end', AFTER_END, **facts)


CHECK = Check(needs=('commanded',), find=_find)
