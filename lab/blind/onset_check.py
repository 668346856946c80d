"""Causes that begin during a recording, on the virtual rig: are they named, with their onset?

    python -m lab.blind.onset_check FOLDER [--first 0] [--cases 10] [--seed 7001]

A pump drops, a weaker bottle follows, a tube is full of water, a camera is knocked, a lamp is
switched on, in turn. Recordings and simulations in the folder are kept, so that an interrupted
check goes on.
"""

import argparse
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.random import Generator

from lab.blind.blind_cases import SMALL, BlindCase, coarse_case, small_schedule
from lab.blind.blind_study import make_recording
from lab.blind.blind_table import is_sure_and_wrong
from lab.blind.simulation_store import SimulationStore
from porotwin_core.basis.units import HOUR_S, to_ml_h
from porotwin_core.model.blind_draw import DrawContext, DrawnValues, displacement, random_sign
from porotwin_core.model.effect_parameter import onset
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.false_cells import without_false_cells
from porotwin_diagnosis.decision.verdict import Verdict
from porotwin_diagnosis.examine import DiagnosisSettings, judge
from porotwin_recording.experiment.recording import open_recording

TIMED = ('rate', 'stock_strength', 'dead_volume', 'registration', 'illumination')
"""Effects that are drawn in turn."""

NEAR = 0.1
"""Largest error of an onset that is right, relative to the recording."""


@dataclass(frozen=True)
class OnsetCase:
    """A recording with a cause over time, and its verdict."""

    case: BlindCase
    verdict: Verdict

    @property
    def named(self) -> bool:
        """Whether the verdict names the cause alone."""
        return self.verdict.members == self.case.right

    @property
    def apart(self) -> float:
        """Error of the onset relative to the recording [-]."""
        (true,), found = self.case.effects, self.verdict.model.effects
        told = next((onset(one) for one in found if one.name == true.name), float('inf'))
        return abs(told - onset(true)) / self.case.duration

    @property
    def right(self) -> bool:
        """Whether cause and onset are right."""
        return self.named and self.apart <= NEAR

    @property
    def is_sure_and_wrong(self) -> bool:
        """Whether the verdict is stated surely, and is not right."""
        verdict = self.verdict
        return is_sure_and_wrong(verdict.name, verdict.confidence, confirmed=self.right)

    @property
    def row(self) -> str:
        """The case as a line of a table."""
        (true,) = self.case.effects
        told = ' and '.join(f'{one.name} {dict(one.parameters)}' for one in self._told)
        return (
            f'{self.case.name} {"right" if self.right else "wrong"} onset {self.apart:.1%} '
            f'{self.verdict.name} {self.verdict.confidence:.2f}: '
            f'{dict(true.parameters)} told as {told or "nothing"}'
        )

    @property
    def _told(self) -> tuple[EffectDescription, ...]:
        return self.verdict.model.effects if self.verdict.kept else ()


def draw_onset(number: int, seed: int) -> BlindCase:
    """Return case `number` of the check with `seed`."""
    generator = np.random.default_rng([seed, number])
    schedule, duration, wells = small_schedule(generator, SMALL)
    name = TIMED[number % len(TIMED)]
    since = float(generator.uniform(0.2, 0.5)) * duration
    injected = to_ml_h(schedule.largest[wells[0]].rate)
    values = _drawn(name, generator, DrawContext(SMALL, wells, duration, injected))
    timed = {} if name == 'dead_volume' else {'since': since}
    effect = EffectDescription(name=name, parameters={**values, **timed})
    noise = int(generator.integers(2**31))
    return coarse_case(f'{name}_{number}', 'single', effect, name, schedule, duration, noise)


def _drawn(name: str, generator: Generator, context: DrawContext) -> DrawnValues:
    """Return the parameters of the effect `name` but its onset."""
    if name == 'registration':
        turn = float(generator.uniform(-0.01, 0.01))
        return displacement(generator, context) | {'rotation': turn}
    if name == 'illumination':
        sizes = ((0.08, 0.2), (0.1, 0.3))
        drawn = [random_sign(generator) * float(generator.uniform(*size)) for size in sizes]
        return {'level': drawn[0], 'gradient': drawn[1]}
    well: DrawnValues = {'well': context.wells[0]}
    if name == 'dead_volume':
        pumped = context.injected_ml_h * context.duration / HOUR_S
        return well | {'volume': float(generator.uniform(0.03, 0.08)) * pumped}
    return well | {'factor': float(generator.uniform(0.6, 0.85))}


def onset_cases(output: Path, numbers: Iterable[int], seed: int) -> Iterator[OnsetCase]:
    """Yield the cases with these `numbers` and their verdicts.

    Raises:
        InputError: a recording is too short to judge.
    """
    for number in numbers:
        case = draw_onset(number, seed)
        folder, made = output / case.name, output / case.name / 'clean.nc'
        if not made.exists():
            make_recording(case, folder / 'recording', clean=folder / 'unfinished.nc')
            (folder / 'unfinished.nc').rename(made)
        recording = without_false_cells(open_recording(folder / 'recording'))
        settings = DiagnosisSettings(crew=SimulationStore(folder / 'simulations'))
        yield OnsetCase(case, judge([recording], settings).verdict)


def main() -> None:
    """Print the cases and their figures."""
    parser = argparse.ArgumentParser(description='Diagnose causes that begin during a recording.')
    parser.add_argument('output', type=Path, help='folder for the recordings')
    parser.add_argument('--first', type=int, default=0, help='number of the first one')
    parser.add_argument('--cases', type=int, default=10, help='number of recordings')
    parser.add_argument('--seed', type=int, default=7001)
    asked = parser.parse_args()
    found = []
    numbers = range(asked.first, asked.first + asked.cases)
    for case in onset_cases(asked.output, numbers, asked.seed):
        print(case.row, flush=True)
        found.append(case)
    print(
        f'named: {sum(case.named for case in found)}, with the onset: '
        f'{sum(case.right for case in found)} of {len(found)}; sure and wrong: '
        f'{sum(case.is_sure_and_wrong for case in found)}'
    )


if __name__ == '__main__':
    main()
