"""Gradients of a cost of a simulation, by the discrete adjoint: exact for the scheme that runs.

A forward sweep keeps the state before every splitting step (`forward_sweep`). The backward sweep
(`backward_sweep`) runs each step once more, records the concentrations before every substep on a
tape, and then applies the transposed derivatives of reaction, diffusion and advection in reverse
order (`step_adjoint`). The limiters have kinks; there the derivative follows the branch that the
forward run took. The kinks alone would let the derivatives grow without end over long runs: they
are kept near the bounds that the equations set (`adjoint_state`).

With the cost J, the coefficients u of a step (fluxes, sources, storage, dispersion) and any rate or
parameter s,

    dJ/ds = sum over the steps of dJ/du du/ds.

The adjoint gives dJ/du. Rates enter u by superposition. For parameters of effects, du/ds is a
difference of coefficients (`parameter_difference`), which needs no further simulation.

Reference: Giles and Pierce, Flow Turbul. Combust. 65 (2000) 393-415. Names that end in `_bar` are
derivatives of J by the quantity without the ending (Griewank and Walther, Evaluating Derivatives).
"""

from porotwin_solver.adjoint.gradients import Cost, Gradient, gradient

__all__ = ['Cost', 'Gradient', 'gradient']
