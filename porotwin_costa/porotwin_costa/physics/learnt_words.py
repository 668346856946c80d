"""Learnt physics in words: every coefficient that is not zero, in the units of the laboratory."""

import math

from porotwin_core.basis.units import to_ml_h
from porotwin_core.model.learnt_physics import LearntPhysics


def coefficient_lines(learnt: LearntPhysics) -> list[str]:
    """Return one line for each coefficient that was learnt, with its unit; none without any."""
    lines = []
    if learnt.density_difference:
        lines.append(f'density of the tracer: {learnt.density_difference:+.3g} kg/m3')
    along, across = learnt.longitudinal_dispersivity, learnt.transverse_dispersivity
    if along or across:
        lines.append(
            f'dispersivity: {1e3 * along:+.3g} mm along the flow, {1e3 * across:+.3g} mm across it'
        )
    if any(learnt.background_flux):
        x, z = (1e6 * flux for flux in learnt.background_flux)
        lines.append(f'background flow: {x:.3g} um/s to the right, {z:.3g} um/s upward')
    if learnt.log_retardation:
        lines.append(f'retardation: factor {math.exp(learnt.log_retardation):.3f}')
    lines += [
        f'leak: {to_ml_h(abs(leak.rate)):.3g} ml/h {"enter" if leak.rate > 0 else "are lost"} '
        f'at x {leak.x:.3f} m, z {leak.z:.3f} m'
        for leak in learnt.leaks
    ]
    lines += [
        f'patch of sand with permeability factor {math.exp(patch.log_factor):.3g}: radius '
        f'{1e3 * patch.radius:.0f} mm at x {patch.x:.3f} m, z {patch.z:.3f} m'
        for patch in learnt.patches
    ]
    return [f'learnt {line}' for line in lines]
