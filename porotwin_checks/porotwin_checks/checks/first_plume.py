"""Can the wells have brought the tracer of the first map to where it is?"""

from collections.abc import Iterator

import numpy as np

from porotwin_checks.known import Known
from porotwin_checks.start import LONGEST_LATENESS, tracer_beyond_reach
from porotwin_core.basis.check import Check
from porotwin_core.basis.remark import Remark
from porotwin_core.model.tracer_share import FILLED_SHARE


def _find(known: Known) -> Iterator[Remark]:
    """Yield a remark if not. The wells count with the volume that a clock may be late for.

    Tracer before a rest is a start that the model takes.
    """
    assert known.rates is not None
    start, end = float(known.times[0]), float(known.times[-1])
    if known.rates.injected_stock(-np.inf, end) <= 0.0:
        return
    far = tracer_beyond_reach(known, start + LONGEST_LATENESS * (end - start))
    if far.mean() > FILLED_SHARE:
        x, z = np.meshgrid(known.grid.x, known.grid.z)
        yield Remark.of(
            'maps',
            '',
            'the first map, at {time_s:g} s, shows tracer around x = {x_m:.3g} m, z = {z_m:.3g} m, '
            'where no well can have brought it yet; is it from before the recording, or a '
            'reflection? Begin with a clean rig, or take a new baseline',
            time_s=start,
            x_m=float(x[far].mean()),
            z_m=float(z[far].mean()),
        )


CHECK = Check(
    needs=('maps', 'rates'),
    find=_find,
    explained_by=('inverted_maps', 'reversed_maps', 'late_or_used', 'earlier_tracer'),
)
