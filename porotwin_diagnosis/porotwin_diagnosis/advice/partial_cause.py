"""Effects of the library that close much of an unexplained gap, and the remainder.

Where two of three causes are known effects, the third one is left as a remainder. Its form is the
one of the maps beside the model with the known effects, and its place is where that model departs
from the recording within single steps. Nothing of this is a verdict: the effects leave more than
true ones would, so that one of them may be an imitation.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.advice.remainder_form import (
    WELL_CLOSED,
    RemainderForm,
    describe_remainder,
)
from porotwin_diagnosis.data.sample import coarsened
from porotwin_diagnosis.decision.held_out import HeldOut, gap_closed_with_interval
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.model.gap_map import Spot, map_gap
from porotwin_diagnosis.search.levels import Levels
from porotwin_recording.experiment.recording import Recording

FORM_COLUMNS = 60
"""Columns of cells on which a remainder is described, about: hundreds of runs take seconds there,
and twice as many columns take eight times as long."""

DIPOLE_RATIO, DIPOLE_WIDTH = 0.6, 0.15
"""Least ratio of the rates of a source and a sink that act like other sand, and their largest
distance as a share of the width of the rig."""


@dataclass(frozen=True)
class PartialCause:
    """The effects that were kept, and the remainder beside them.

    Attributes:
        model: the fit of the effects.
        closed: share of the gap that they close in the held-out part [-].
        form: the form of the remainder beside them.
        spot: the place where most of the remainder arises; None if no place stands out.
    """

    model: Fit
    closed: float
    form: RemainderForm
    spot: Spot | None


def is_dipole(effects: Sequence[EffectDescription], width: float) -> bool:
    """Return whether `effects` are a source beside an equally strong sink, in a rig of this width.

    Sand that conducts better or worse than its surroundings acts like that. A round patch in a
    uniform flow is exactly a dipole, like a dielectric cylinder in a uniform field.

    Args:
        effects: effects of a model.
        width: width of the rig [m].
    """
    leaks = [effect for effect in effects if effect.water_ml_h]
    if len(leaks) != 2:
        return False
    one, other = (leak.parameters for leak in leaks)
    rates = [leak.water_ml_h for leak in leaks]
    apart = math.hypot(*(float(one[axis]) - float(other[axis]) for axis in ('x', 'z')))
    weaker, stronger = sorted(map(abs, rates))
    opposite = math.prod(rates) < 0.0
    return opposite and weaker > DIPOLE_RATIO * stronger and apart < DIPOLE_WIDTH * width


def form_model(levels: Levels) -> Forward:
    """Return the model of the first recording, on cells coarse enough for hundreds of runs."""
    forward = levels.screening.forwards[0].uncorrected()
    factor = round(forward.sample.grid.nx / FORM_COLUMNS)
    if factor < 2:
        return forward
    return Forward(coarsened(forward.sample, factor), refinement=1, crew=forward.crew)


def partial_cause(
    recordings: Sequence[Recording],
    levels: Levels,
    model: Fit,
    held_out: Sequence[HeldOut],
    *,
    excluded: Sequence[str] = (),
) -> PartialCause | None:
    """Return the part that `model` closes, and the remainder; None if the part is too small.

    Args:
        recordings: the recordings.
        levels: their levels; the form belongs to the first recording.
        model: the fit that was kept, without being sufficient.
        held_out: the held-out parts without and with `model`.
        excluded: names of library effects that are no causes.

    Raises:
        InputError: the model cannot run with these effects.
    """
    closed, _ = gap_closed_with_interval(held_out)
    if not model.members or closed < WELL_CLOSED:
        return None
    form = describe_remainder(
        form_model(levels), model.effects, excluded=excluded, pool=levels.pool
    )
    spots = map_gap(*recordings, effects=model.effects).spots
    return PartialCause(model, closed, form, spots[0] if spots else None)
