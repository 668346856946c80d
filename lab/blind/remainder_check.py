"""The descriptions of gaps that effects from outside the library make, beside their truth.

    python -m lab.blind.remainder_check OUTPUT [--cases 3] [--seed 91]

The virtual rig records every effect of `OUTSIDE` several times, on the small rig with cells of
1 cm. The form of each gap is compared with the process that the effect changes and with its place.
Recordings that are in OUTPUT already are kept.
"""

import argparse
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lab.blind.blind_cases import SMALL, BlindCase, coarse_case, small_schedule
from lab.blind.blind_study import make_recording
from porotwin_cli.running.drawn_effects import OUTSIDE, drawn
from porotwin_core.basis.units import from_ml_h
from porotwin_core.model.blind_draw import DrawContext
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.advice.partial_cause import form_model
from porotwin_diagnosis.advice.remainder_form import RemainderForm, describe_remainder
from porotwin_diagnosis.data.sample import read_sample
from porotwin_diagnosis.progress import no_progress
from porotwin_diagnosis.search.levels import make_levels
from porotwin_recording.experiment.recording import open_recording

RIGHT: Mapping[str, tuple[str, ...]] = {
    'anisotropy': ('transport',),
    'freundlich': ('storage',),
    'pulsation': ('source',),
    'pump_drift': ('source',),
    'reflection': ('camera',),
    'settling': ('transport',),
    'stain': ('camera', 'storage'),
    'streak': ('transport',),
    'water_table': ('transport', 'source'),
}
"""Kinds that describe an effect from outside the library rightly."""


@dataclass(frozen=True)
class DescribedCase:
    """A gap, its truth and its description.

    Attributes:
        name: name of the case.
        effect: the hidden effect.
        form: the description.
        apart_m: distance of the described from the true place [m]; infinite if no place is told,
            None if the effect has no place.
    """

    name: str
    effect: EffectDescription
    form: RemainderForm
    apart_m: float | None

    @property
    def kind_is_right(self) -> bool:
        """Whether the kind of the strongest cause is right."""
        return self.form.kind in RIGHT[self.effect.name]

    @property
    def row(self) -> str:
        """The case as a line of a table."""
        place = '' if self.apart_m is None else f'{self.apart_m:.3f} m apart'
        words = '; '.join(term.words for term in self.form.terms) or 'no form'
        right = 'right' if self.kind_is_right else 'wrong'
        return f'{self.name:16s} {right} {self.form.closed:4.0%} {place:14s} {words}'


def described_cases(output: Path, cases: int, seed: int) -> Iterator[DescribedCase]:
    """Yield `cases` recordings of every effect of `OUTSIDE` with their descriptions.

    Raises:
        InputError: an effect is impossible, or a recording is too short to judge.
    """
    for name in OUTSIDE:
        for number in range(cases):
            case = _case(name, number, seed)
            folder = output / case.name
            if not (folder / 'clean.nc').exists():
                make_recording(case, folder / 'recording', clean=folder / 'unfinished.nc')
                (folder / 'unfinished.nc').rename(folder / 'clean.nc')
            levels = make_levels(
                [read_sample(open_recording(folder / 'recording'))], progress=no_progress
            )
            form = describe_remainder(form_model(levels))
            yield DescribedCase(case.name, case.effects[0], form, _apart(case, form))


def _case(name: str, number: int, seed: int) -> BlindCase:
    generator = np.random.default_rng([seed, number, sum(map(ord, name))])
    schedule, duration, wells = small_schedule(generator, SMALL)
    injected = max(row.rate.rate for row in schedule.rows) / from_ml_h(1.0)
    effect = drawn(name, generator, DrawContext(SMALL, wells, duration, injected))
    noise, case = int(generator.integers(2**31)), f'{name}_{number}'
    return coarse_case(case, 'outside', effect, 'unexplained', schedule, duration, noise)


def _apart(case: BlindCase, form: RemainderForm) -> float | None:
    """Return the distance of the first place in `form` from the one of the effect [m]."""
    values = case.effects[0].parameters
    if 'well' in values:
        well = case.rig.wells[str(values['well'])]
        true = (well.x_m, well.z_m)
    elif 'x_end' in values:
        true = (_middle(values, 'x', 'x_end'), _middle(values, 'z', 'z_end'))
    elif 'x' in values:
        climbed = float(values.get('climb', 0.0)) * 0.5 * case.duration
        true = (float(values['x']), float(values['z']) + climbed)
    else:
        return None
    place = next((term.place for term in form.terms if term.place), None)
    return math.inf if place is None else math.dist(true, place)


def _middle(values: Mapping[str, float | str], one: str, other: str) -> float:
    return 0.5 * (float(values[one]) + float(values[other]))


def main() -> None:
    """Print the descriptions and their figures."""
    parser = argparse.ArgumentParser(description='Describe gaps from outside the library.')
    parser.add_argument('output', type=Path, help='folder for the recordings')
    parser.add_argument('--cases', type=int, default=3, help='recordings of every effect')
    parser.add_argument('--seed', type=int, default=91)
    asked = parser.parse_args()
    found = []
    for case in described_cases(asked.output, asked.cases, asked.seed):
        print(case.row, flush=True)
        found.append(case)
    right = sum(case.kind_is_right for case in found)
    closed = float(np.median([case.form.closed for case in found]))
    print(f'kind right: {right} of {len(found)}; closed in the median: {closed:.0%}')


if __name__ == '__main__':
    main()
