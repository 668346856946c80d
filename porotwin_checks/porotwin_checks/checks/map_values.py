"""Are the values of maps concentrations? 0 is water, 1 is the tracer stock."""

from collections.abc import Iterator

import numpy as np

from porotwin_checks.checks.lone_cells import MOST_FALSE
from porotwin_checks.known import VISIBLE_TRACER, Known
from porotwin_core.basis.check import Check
from porotwin_core.basis.remark import Remark
from porotwin_core.basis.text_with_unit import PERCENT

MOST_STOCK = 1.3
"""Concentration above which a map is odd [-]; noise and light lift it above 1, but no further."""

LEAST_PERCENT = 10.0
"""Largest value from which a map is probably in percent; far above 100, it is a picture."""

FAINT, LEAST_PLUME_CELLS = 0.4, 50.0
"""Concentration over the injected one below which maps are odd, and the least volume of the
injected stock [cells] of a plume larger than its fronts."""

FAINT_WORDS = (
    'the strongest tracer has {largest:.3g}, while the pumps inject {injected:g}, and a plume this '
    'large is nearly as strong at its well; is 1 the stock? Import them with --stock, or scale them'
)


def _find(known: Known) -> Iterator[Remark]:
    """Yield the remark about the first, middle and last map."""
    assert known.maps is not None
    count = len(known.times)
    values = np.array([known.maps[number] for number in sorted({0, count // 2, count - 1})])
    if not np.isfinite(values).any():
        return
    largest = float(np.nanmax(values))
    if largest > MOST_STOCK:
        code, remedy = 'no_stock', 'scale the maps'
        if largest > MOST_STOCK * PERCENT:
            remedy = 'are these grey values of pictures? Make maps with image, or scale them'
        elif largest > LEAST_PERCENT:
            remedy = 'was this in percent? 1 is the tracer stock'
        if np.nanmean(values > MOST_STOCK) < MOST_FALSE:
            code, remedy = 'hot_cells', 'single cells, such as a glare: write NaN there'
        words = f'they go up to {{largest:.3g}}, where 0 is water and 1 is stock; {remedy}'
        yield Remark.of('maps', code, words, largest=largest)
    elif largest > VISIBLE_TRACER and known.rates is not None:
        rows = [row.rate for row in known.rates.rows if row.rate.rate > 0.0]
        injected = max((rate.concentration for rate in rows), default=0.0)
        stock = known.rates.injected_stock(0.0, float(known.times[-1]))
        cell = float(np.mean(known.rig.cell_pore_volume(known.grid)))
        if stock >= LEAST_PLUME_CELLS * cell * injected and largest < FAINT * injected:
            yield Remark.of('maps', 'faint_maps', FAINT_WORDS, largest=largest, injected=injected)


CHECK = Check(needs=('maps',), find=_find)
