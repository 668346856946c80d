"""The permeability of the sand rises and falls in a wave across the rig.

log k changes by log_amplitude * cos(pi half_waves_x x / W) * cos(pi half_waves_z z / H). No search
fits single waves; together they stand for the doubt about uneven sand.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from porotwin_core.model.effect_limits import MOST_HALF_WAVES, MOST_PERMEABILITY_FACTOR
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_core.rig import Rig
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter
from porotwin_solver.effects.definition.effect import Effect, Scope
from porotwin_solver.effects.definition.words import factor

WAVES = tuple(wave for wave in itertools.product(range(4), range(3)) if 0 < wave[0] + wave[1] <= 3)
"""Believed half waves along x and z: of 1/3 of the rig and above; smaller scales bend the plume
little."""

DEVIATION = 0.25
"""Standard deviation of the believed log permeability in one wave of the longest kind [-]."""

LARGEST = math.log(MOST_PERMEABILITY_FACTOR)


def undulate(physics: Physics, values: Values) -> Physics:
    """Return `physics` with one more wave."""
    grid = physics.grid
    along_x = np.cos(math.pi * values['half_waves_x'] * grid.x / grid.width)
    along_z = np.cos(math.pi * values['half_waves_z'] * grid.z / grid.height)
    wave = values['log_amplitude'] * np.outer(along_z, along_x)
    return replace(physics, permeability=physics.permeability * np.exp(wave))


def believed(_rig: Rig) -> Sequence[Candidate]:
    """Believe in uneven sand, less on smaller scales."""
    return [
        Candidate(
            'wave',
            (FitParameter('log_amplitude', '-', 0.0, DEVIATION / max(i, j), -LARGEST, LARGEST),),
            {'half_waves_x': float(i), 'half_waves_z': float(j)},
            variant=f'{i} {j}',
        )
        for i, j in WAVES
    ]


def phrase(values: Values) -> str:
    """Say how much the permeability changes, and on which scale."""
    change = factor(math.exp(abs(values['log_amplitude'])), 'more', 'less', 'the nominal one')
    return (
        f'the permeability rises and falls by {change}, in {values["half_waves_x"]:g} half waves '
        f'across and {values["half_waves_z"]:g} upward'
    )


EFFECT = Effect(
    name='wave',
    order=138,
    scope=Scope.RIG,
    parameters={
        'half_waves_x': Parameter(unit='-', low=0.0, high=MOST_HALF_WAVES, is_scored=False),
        'half_waves_z': Parameter(unit='-', low=0.0, high=MOST_HALF_WAVES, is_scored=False),
        'log_amplitude': Parameter(unit='-', low=-LARGEST, high=LARGEST),
    },
    on_physics=undulate,
    believed=believed,
    phrase=phrase,
    plainly='the sand is packed unevenly',
    laboratory_check='inject a pulse from several wells and compare the shapes of the plumes',
)
