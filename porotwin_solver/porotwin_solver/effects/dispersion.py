"""The tracer spreads: D = diffusion + Scheidegger's tensor in the pore velocity.

D = (diffusion + a_T |v|) I + (a_L - a_T) v v^T / |v|, a_L and a_T the dispersivities along and
across the flow (Bear, Dynamics of Fluids in Porous Media, sec. 10.4).
"""

from collections.abc import Sequence
from dataclasses import replace

from numpy.random import Generator

from porotwin_core.basis.units import MOLECULAR_DIFFUSION
from porotwin_core.model.blind_draw import DrawContext, DrawnValues, log_uniform
from porotwin_core.model.effect_limits import MOST_DIFFUSION, MOST_DISTANCE
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_core.rig import Rig
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Appearance, Effect, Scope
from porotwin_solver.effects.definition.words import number

TRANSVERSE_SHARE = 0.1
"""Dispersivity across the flow relative to that along it [-], as usual in sand (Bear, Dynamics of
Fluids in Porous Media, sec. 10.4)."""

GRAIN_M, GRAIN_DEVIATION = 4e-4, 1.2
"""Median of the believed longitudinal dispersivity [m], about a grain, and the deviation of its
logarithm [-]."""

MOST_BELIEVED_M = 0.05
"""Largest longitudinal dispersivity that is believed [m], four deviations above the median.
Photographs that contradict the rates would lead to kilometres, and a run with them does not end."""


def spread(physics: Physics, values: Values) -> Physics:
    """Return `physics` with these coefficients of spreading."""
    return replace(
        physics,
        longitudinal_dispersivity=values['longitudinal_dispersivity'],
        transverse_dispersivity=values['transverse_dispersivity'],
        diffusion=values['diffusion'],
    )


def present(physics: Physics) -> Values:
    """Return the coefficients of spreading that `physics` has."""
    return {
        'longitudinal_dispersivity': physics.longitudinal_dispersivity,
        'transverse_dispersivity': physics.transverse_dispersivity,
        'diffusion': physics.diffusion,
    }


def believed(_rig: Rig) -> Sequence[Candidate]:
    """Believe in a dispersivity of about a grain, known to a factor of three."""
    name = 'longitudinal_dispersivity'
    along = FitParameter(name, 'm', GRAIN_M, GRAIN_DEVIATION, 0.0, MOST_BELIEVED_M, log=True)
    tied = {'transverse_dispersivity': (name, TRANSVERSE_SHARE)}
    return [Candidate('dispersion', (along,), tied=tied)]


def candidates(context: SearchContext) -> Sequence[Candidate]:
    """Fit both dispersivities, or the diffusion alone, starting where it spreads by one cell."""
    along = FitParameter('longitudinal_dispersivity', 'm', 1e-3, 0.25, 1e-6, 0.2, log=True)
    across = FitParameter('transverse_dispersivity', 'm', 1e-4, 0.4, 1e-7, 0.1, log=True)
    one_cell = context.grid.dx**2 / context.duration
    diffusion = FitParameter(
        'diffusion', 'm2/s', one_cell, 0.25, MOLECULAR_DIFFUSION, 1e-5, log=True
    )
    return [
        Candidate('dispersion', (along, across), {'diffusion': MOLECULAR_DIFFUSION}),
        Candidate(
            'dispersion',
            (diffusion,),
            {'longitudinal_dispersivity': 0.0, 'transverse_dispersivity': 0.0},
            variant='diffusion',
        ),
    ]


def phrase(values: Values) -> str:
    """Say how the tracer spreads: by dispersion, or by diffusion."""
    if values['longitudinal_dispersivity'] > 0:
        return (
            'the tracer spreads on its way: dispersivity '
            f'{number(1e3 * values["longitudinal_dispersivity"])} mm along the flow, '
            f'{number(1e3 * values["transverse_dispersivity"])} mm across'
        )
    diffusion = values['diffusion']
    if diffusion < 1.05 * MOLECULAR_DIFFUSION:
        return 'the tracer spreads no more than by molecular diffusion'
    return (
        f'the tracer spreads as by a diffusion of {number(diffusion)} m²/s, '
        f'{number(diffusion / MOLECULAR_DIFFUSION)} times the molecular one'
    )


def draw(generator: Generator, context: DrawContext) -> DrawnValues:
    """Draw 0.6 to 4 mm along the flow on the small rig, and 5 to 20 % of that across it."""
    along = log_uniform(generator, 6e-4, 4e-3) * context.size
    return {
        'longitudinal_dispersivity': along,
        'transverse_dispersivity': along * log_uniform(generator, 0.05, 0.2),
        'diffusion': MOLECULAR_DIFFUSION,
    }


def gradient_obstacle(physics: Physics, parameter: str) -> str:
    """Refuse gradients where the pairs of cells that exchange tracer change with the parameter.

    Without diffusion there are no pairs; with equal dispersivities there are no oblique pairs.
    """
    if physics.diffusion + physics.model_diffusion == 0.0:
        return 'not available without any diffusion; give a little, such as 1e-10 m2/s'
    equal = physics.longitudinal_dispersivity == physics.transverse_dispersivity
    if equal and parameter.endswith('dispersivity'):
        return (
            'not available where both dispersivities are equal; '
            'give the longitudinal one 1e-7 m more'
        )
    return ''


EFFECT = Effect(
    name='dispersion',
    order=10,
    scope=Scope.RIG,
    parameters={
        'longitudinal_dispersivity': Parameter(
            unit='m', low=0.0, high=MOST_DISTANCE, may_be_fixed=True
        ),
        'transverse_dispersivity': Parameter(
            unit='m', low=0.0, high=MOST_DISTANCE, may_be_fixed=True
        ),
        'diffusion': Parameter(
            unit='m2/s',
            low=0.0,
            high=MOST_DIFFUSION,
            default=MOLECULAR_DIFFUSION,
            may_be_fixed=True,
            is_scored=False,
        ),
    },
    on_physics=spread,
    candidates=candidates,
    phrase=phrase,
    plainly='the tracer spreads on its way',
    laboratory_check=(
        'repeat at half the rates: dispersion goes with distance, diffusion with time'
    ),
    blind_draw=draw,
    appearance=Appearance.SPREADING,
    present=present,
    believed=believed,
    is_slow_on_fine_grids=True,
    gradient_obstacle=gradient_obstacle,
    is_learnable=True,
)
