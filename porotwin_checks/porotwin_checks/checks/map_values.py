"""Are the values of maps concentrations? 0 is water, 1 is the tracer stock."""

from collections.abc import Iterator

import numpy as np

from porotwin_checks.checks.lone_cells import MOST_FALSE
from porotwin_checks.known import Known
from porotwin_core.basis.check import Check
from porotwin_core.basis.remark import Remark
from porotwin_core.basis.text_with_unit import PERCENT
from porotwin_core.model.tracer_share import PLUME_THRESHOLD
from porotwin_solver.effects import tracer_storage

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
    """Yield a remark about the scale of the maps; `lone_cells` tells a few false cells."""
    assert known.maps is not None
    values = np.array([known.maps[number] for number in known.looked_at])
    if not np.isfinite(values).any():
        return
    largest = float(np.nanmax(values))
    if np.mean(values > MOST_STOCK, axis=(1, 2)).max() > MOST_FALSE:
        remedy = 'scale the maps'
        if largest > MOST_STOCK * PERCENT:
            remedy = 'are these grey values of pictures? Make maps with image, or scale them'
        elif largest > LEAST_PERCENT:
            remedy = 'was this in percent? 1 is the tracer stock'
        words = f'they go up to {{largest:.3g}}, where 0 is water and 1 is stock; {remedy}'
        yield Remark.of('maps', 'no_stock', words, largest=largest)
    elif largest > PLUME_THRESHOLD and known.rates is not None:
        rows = [row.rate for row in known.rates.rows if row.rate.rate > 0.0]
        injected = max((rate.concentration for rate in rows), default=0.0)
        stock = known.rates.injected_stock(0.0, float(known.times[-1]))
        cell = float(np.mean(tracer_storage(known.rig, known.grid)))
        if stock >= LEAST_PLUME_CELLS * cell * injected and largest < FAINT * injected:
            yield Remark.of('maps', 'faint_maps', FAINT_WORDS, largest=largest, injected=injected)


CHECK = Check(needs=('maps',), find=_find)
