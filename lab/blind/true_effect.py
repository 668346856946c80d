"""The remainder beside the true effect: a check of the limits of the diagnosis.

    python -m lab.blind.true_effect 4 [EFFECT ...]

The diagnosis believes a model whose lack of fit is at most 1. Here the virtual rig has one effect
with random parameters. The diagnosis knows the effect, starts from its true parameters, and refines
them as in its final judgement. A lack of fit above 1 then comes from the scheme or from the noise,
and the effect would be called unexplained. Cells are 1 cm wide, so that a case takes seconds.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from lab.blind.blind_cases import BlindCase, draw_case
from lab.blind.blind_study import make_recording
from porotwin_cli.running.drawn_effects import LIBRARY, drawn
from porotwin_core.basis.units import from_ml_h
from porotwin_core.model.blind_draw import DrawContext
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.sample import Sample, read_sample
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.model.library import library
from porotwin_diagnosis.model.polishing import polished
from porotwin_diagnosis.search.levels import make_levels
from porotwin_diagnosis.search.ranking import lack_of_fit
from porotwin_recording.experiment.recording import open_recording
from porotwin_solver.effects.definition.candidate import Candidate

FIRST_SEED = 650
"""Seed of the first case; another number and another effect have seeds of their own."""

SEEDS_BETWEEN = 40
"""Seeds between two cases of one effect, more than there are effects."""

SINGLE = 1
"""Number of a case with one effect on the small rig in every blind check."""


def case_with(name: str, number: int) -> BlindCase:
    """Return case `number` of the effect `name`: a coarse recording with random parameters."""
    seed = FIRST_SEED + SEEDS_BETWEEN * number + list(LIBRARY).index(name)
    case = draw_case(SINGLE, seed, coarse=True)
    rows = case.schedule.rows
    rate = max(row.rate.rate for row in rows) / from_ml_h(1.0)
    context = DrawContext(case.rig, case.schedule.wells, case.duration, rate)
    effect = drawn(name, np.random.default_rng(seed), context)
    return replace(case, name=f'{name}_{number}', effects=(effect,), right=(name,))


def lack_left(recording: Path, effect: EffectDescription) -> float:
    """Return the lack of fit [-] that the true `effect` leaves in `recording`, the least one of its
    variants.

    Raises:
        InputError: the recording is too short to judge.
    """
    sample = read_sample(open_recording(recording))
    return min(_judged(sample, candidate, effect) for candidate in variants(sample, effect))


def variants(sample: Sample, effect: EffectDescription) -> list[Candidate]:
    """Return the candidates of the library that can be `effect`, at its well."""
    well = effect.parameters.get('well')
    return [
        candidate
        for candidate in library([sample])
        if candidate.effect == effect.name and candidate.fixed.get('well') == well
    ]


def true_fit(candidate: Candidate, effect: EffectDescription) -> Sequence[float]:
    """Return the scaled parameters of `candidate` that are those of `effect`."""
    return [
        parameter.scaled(float(effect.parameters[parameter.name]))
        for parameter in candidate.parameters
    ]


def _judged(sample: Sample, candidate: Candidate, effect: EffectDescription) -> float:
    levels = make_levels([sample], progress=lambda _stage, _share: None)
    scaled = np.array(true_fit(candidate, effect))
    true: Fit = levels.judging.evaluate((candidate,), scaled)
    again = polished(levels.corrected_at(true).judging, true, levels.refining)
    return lack_of_fit(again, levels.null())


def measured(names: Sequence[str], draws: int) -> Iterator[tuple[str, list[float]]]:
    """Yield every effect with the lack of fit [-] of each of its `draws` cases."""
    for name in names:
        found = []
        for number in range(draws):
            case = case_with(name, number)
            with TemporaryDirectory() as folder:
                recording = Path(folder) / 'recording'
                make_recording(case, recording)
                found.append(lack_left(recording, case.effects[0]))
        yield name, found


def main() -> None:
    """Print the table for the number of draws and the effects on the command line."""
    draws, *names = sys.argv[1:] or ['1']
    for name, lacks in measured(names or list(LIBRARY), int(draws)):
        print(f'{name:16} ' + ' '.join(f'{lack:.2f}' for lack in lacks), flush=True)


if __name__ == '__main__':
    main()
