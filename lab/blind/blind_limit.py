"""The limit of a recording: do its true maps explain it better than the diagnosis does?

A diagnosis that knew everything would predict the true maps. Its misfit comes from noise and from
the errors of imaging alone. If the model that was named has hardly more misfit, no rule on this
recording can prefer the truth, whatever the solver and the search.
"""

import json
from pathlib import Path

import numpy as np

from porotwin_diagnosis.data.misfit import misfit
from porotwin_diagnosis.data.sample import read_sample
from porotwin_diagnosis.search.ranking import log_odds_against, overall_misfit
from porotwin_diagnosis.thresholds import NEAR_EQUAL_LOG_ODDS
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.tables.concentration import open_maps

BLURS = (0.0, 0.3, 0.5, 0.7, 0.9)
"""Widths of the point spread [cells] that the true maps may need, as in the diagnosis."""


def truth_is_visible(recording: Path, result: Path, clean: Path) -> bool:
    """Return whether the true maps explain a recording clearly better than its diagnosis does.

    Clearly better are odds of more than 3 : 1 by the misfits of both.

    Args:
        recording: folder of the recording.
        result: folder of the diagnosis.
        clean: file with the maps of the recording without noise.
    """
    stated = json.loads((result / 'diagnosis.json').read_text(encoding='utf-8'))
    named = float(stated['misfit']['after'])
    return log_odds_against(named, misfit_of_truth(recording, clean)) > NEAR_EQUAL_LOG_ODDS


def misfit_of_truth(recording: Path, clean: Path) -> float:
    """Return the misfit [-] of the true maps `clean`, with the point spread that suits them best.

    The arguments are as in `truth_is_visible`.
    """
    sample = read_sample(open_recording(recording))
    true = open_maps(clean, sample.rig)
    shown = np.searchsorted(true.times, sample.times - 1e-6)
    maps = np.stack([true[int(index)] for index in shown]).astype(float)
    residuals = (sample.whitened(maps, point_spread_width=width) for width in BLURS)
    return min(overall_misfit(*misfit([sample], [residual])) for residual in residuals)
