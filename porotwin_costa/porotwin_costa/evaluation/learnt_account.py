"""What was learnt: the share of the gap between model and maps that each part of it takes."""

from dataclasses import replace

import numpy as np

from porotwin_core.geometry.grid import FloatArray
from porotwin_costa.correction.corrective_model import CorrectiveModel
from porotwin_costa.correction.free_run_gate import Judge


def gap_shares(bare: Judge, judge: Judge, model: CorrectiveModel) -> dict[str, float]:
    """Return the shares of the squared error of free runs that each part of the model takes [-].

    Args:
        bare: free runs of the model without any named effect.
        judge: the same runs of the model with the named effects.
        model: the correction of the latter.

    The shares add up to 1; one is negative where a part makes the runs worse.
    """
    physics, whole = (judge.errors(one) for one in (replace(model, trust=0.0), model))

    def left(errors: FloatArray) -> float:
        return float(np.mean(errors**2)) / (float(np.mean(bare.alone**2)) or 1.0)

    named, learnt, rest = left(judge.alone), left(physics.corrected), left(whole.corrected)
    return {
        'named effects': 1.0 - named,
        'learnt physics and scheme': named - learnt,
        'network': learnt - rest,
        'remainder': rest,
    }
