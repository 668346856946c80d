"""The light of a photograph: what is corrected, and which cells can be compared with the baseline.

The drift of light is removed first (`light_drift.py`), then soft shadows (`local_light.py`). The
rest must be tracer: cells that are brighter (`light_check.py`) or have another colour
(`foreign_signal.py`) have no value.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.foreign_signal import without_foreign_signal
from porotwin_imaging.light_check import exposure_remarks, lit_as_baseline, refuse_unknown_light
from porotwin_imaging.light_drift import LightDrift, light_drift
from porotwin_imaging.local_light import local_light
from porotwin_imaging.settings import DEFAULTS, ImagingSettings
from porotwin_imaging.tracer_colour import TracerColour, colour_in

Array = NDArray[Any]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class CorrectedLight:
    """Log ratios to the baseline without the changes of light.

    Attributes:
        log_ratio: log ratios, shape (nz, nx, 3).
        variance: variance that the correction adds, shape (nz, nx).
        comparable: visible cells whose change tracer can make, shape (nz, nx).
        drift: the drift of light that was removed.
        remarks: what was corrected, one line each.
        left_out: what could not be corrected, one line each.
    """

    log_ratio: Array
    variance: Array
    comparable: Mask
    drift: LightDrift
    remarks: list[str]
    left_out: list[str]


def corrected_light(
    log_ratio: Array,
    visible: Mask,
    share: Array,
    checker_gain: Array | None,
    colour: TracerColour | None,
    settings: ImagingSettings = DEFAULTS,
) -> CorrectedLight:
    """Return log ratios without the changes of light.

    Args:
        log_ratio: log ratio of photograph to baseline, shape (nz, nx, 3).
        visible: cells that show their sand, shape (nz, nx).
        share: usable share of each cell, shape (nz, nx).
        checker_gain: log gain at the colour chart, shape (3,), or None.
        colour: colour of the tracer from the calibration; if None, the photograph is asked.
        settings: settings of all steps.

    Raises:
        InputError: the light cannot be compared with the baseline.
    """
    drift = light_drift(log_ratio, np.where(visible, share, 0.0), checker_gain, settings.light)
    refuse_unknown_light(log_ratio, visible, drift, chart_seen=checker_gain is not None)
    residual = drift.removed_from(log_ratio)
    remarks = exposure_remarks(checker_gain, settings.light)
    colour = colour or colour_in(residual, visible)
    local = local_light(residual, visible, colour, settings.local_light)
    variance: Array = np.zeros(visible.shape, np.float32)
    if local is not None:
        residual = residual - local.log_gain[..., None]
        variance = local.variance
        remarks += local.remarks
    comparable, bright = lit_as_baseline(residual, visible, settings.light)
    comparable, foreign = without_foreign_signal(
        residual, comparable, colour, settings.foreign_signal
    )
    return CorrectedLight(residual, variance, comparable, drift, remarks, [*bright, *foreign])
