"""Do the rates of a closed rig add up to zero? Its water has no other way out.

Photographs can be evaluated without, but no model predicts with such rates.
"""

import itertools
import math
from collections.abc import Iterator
from operator import attrgetter

from porotwin_checks.known import Known
from porotwin_core.basis.check import Check
from porotwin_core.basis.floors import ROUND_OFF
from porotwin_core.basis.remark import Remark
from porotwin_core.basis.units import to_ml_h

UNBALANCED = (
    'the rates add up to {sum_ml_h:.6g} ml/h, but all sides are closed; balance injection and '
    'production, or open a side in rig.yaml'
)


def _find(known: Known) -> Iterator[Remark]:
    """Yield a remark about the first time with a sum that is not zero.

    The model runs with the rates that were measured, where somebody measured them.
    """
    rates = known.pumped or known.commanded
    assert rates is not None
    running: dict[str, float] = {}
    for time, changes in itertools.groupby(rates.rows, attrgetter('time')):
        running |= {row.well: row.rate.rate for row in changes}
        net, total = math.fsum(running.values()), math.fsum(map(abs, running.values()))
        if known.rig.closed and abs(net) > ROUND_OFF * total:
            key, facts = f'rates at {time:g} s', {'time_s': time, 'sum_ml_h': to_ml_h(net)}
            yield Remark.of(key, 'unbalanced_rates', UNBALANCED, **facts)
            return


CHECK = Check(needs=('commanded',), find=_find)
