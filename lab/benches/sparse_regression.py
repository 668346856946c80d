"""The baseline of the diagnosis: weak-form sparse regression of the residual, by pysindy.

The one-step residual r = (observed - predicted) / dt is regressed on terms of the tracer field:

    r = a1 c + a2 (dc/dt)_model + a3 dc/dx + a4 dc/dz + a5 d2c/dx2 + a6 d2c/dz2

in weak form with sequentially thresholded least squares (Brunton et al., PNAS 113 (2016) 3932;
Messenger & Bortz, J. Comput. Phys. 443 (2021) 110525). The term that explains most of the residual
names an effect. No term can name a camera, a well or a place.
"""

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_diagnosis.model.gap_map import observed_maps
from porotwin_recording.experiment.recording import Recording
from porotwin_solver.model.model import Model

TERMS = {
    'c': 'c', 'dc/dt': 'm', 'dc/dx': 'c_2', 'dc/dz': 'c_1', 'd2c/dx2': 'c_22', 'd2c/dz2': 'c_11',
}  # fmt: skip
"""pysindy's names of the terms of the equation; dc/dt is the model's, and the first axis is z."""

EFFECT_OF_TERM = {
    'c': 'decay', 'dc/dt': 'porosity', 'dc/dx': 'background_flow', 'dc/dz': 'buoyancy',
    'd2c/dx2': 'dispersion', 'd2c/dz2': 'dispersion',
}  # fmt: skip
"""The effect that each term names."""

THRESHOLD = 0.15
"""Terms whose normalised coefficient is below this value are dropped: they explain about 2 % of the
residual's energy."""

RIDGE = 1e-3
"""Weight of the squared coefficients, which keeps the regression of nearly equal terms stable."""

LEAST_SHARE = 0.1
"""Share of the residual's energy that the regression must explain to name an effect."""

COARSENING = 3
"""Cells of the recording per cell of the regression, because derivatives amplify noise."""

FRAMES = 41
"""Frames that are compared, evenly spread over the recording."""

DOMAINS, SEED = 400, 7
"""Number of test functions, which are placed at random with this seed: many more than terms."""

TEST_FUNCTION_SIZE = (0.12, 0.12, 0.15)
"""Half widths of a test function relative to height, width and duration: wider than a front."""


class _Steps(NamedTuple):
    """One-step predictions: frames, their rate of change by the model, and the missing change.

    Attributes:
        state: c and (dc/dt)_model, (nz, nx, nt, 2).
        missing: observed - predicted, (nz, nx, nt).
        times: middle of each step, evenly spaced [s], (nt,).
    """

    state: FloatArray
    missing: FloatArray
    times: FloatArray


def sparse_regression(recording: Recording) -> str:
    """Return the effect that sparse regression names, or `none` if it finds no term."""
    import pysindy

    grid = recording.grid
    coarse = recording.rig.grid(grid.nx // COARSENING, grid.nz // COARSENING)
    steps = _one_steps(recording, coarse)
    axes = np.meshgrid(coarse.z, coarse.x, steps.times, indexing='ij')
    duration = steps.times[-1] - steps.times[0]
    sizes = (coarse.height, coarse.width, duration)
    library = pysindy.WeakPDELibrary(
        pysindy.PolynomialLibrary(degree=1, include_bias=False),
        derivative_order=2,
        spatiotemporal_grid=np.stack(axes, axis=-1),
        K=DOMAINS,
        H_xt=[share * size for share, size in zip(TEST_FUNCTION_SIZE, sizes, strict=True)],
    )
    np.random.seed(SEED)  # the library draws its test functions from numpy's global generator
    wrapped = _with_axes(steps.state)
    library.fit([wrapped])
    features = np.asarray(library.transform([wrapped])[0])
    names = library.get_feature_names(['c', 'm'])
    total = np.cumsum(steps.missing, axis=2)[..., None]
    target = np.asarray(library.convert_u_dot_integral(_with_axes(total)))
    return _named(
        features[:, [names.index(term) for term in TERMS.values()]], target, pysindy.STLSQ
    )


def _one_steps(recording: Recording, grid: Grid) -> _Steps:
    """Return one-step predictions from each observed frame of `recording` on `grid`."""
    times, maps, _ = observed_maps(recording, grid, FRAMES)
    model = Model(recording.rig, grid, preset='fast')
    modelled = np.zeros((grid.nz, grid.nx, len(times) - 1))
    missing = np.zeros_like(modelled)
    steps = zip(pairwise(times), pairwise(maps), strict=True)
    for index, ((start, end), (before, after)) in enumerate(steps):
        predicted = before
        for low, high, rates in recording.delivered.intervals(start, end):
            predicted = model.predict(predicted, rates, high - low)
        modelled[:, :, index] = (predicted - before) / (end - start)
        missing[:, :, index] = after - predicted
    middles = 0.5 * (times[1:] + times[:-1])
    state = np.stack([np.stack(maps[:-1], axis=-1), modelled], axis=-1)
    return _Steps(state, missing, np.linspace(middles[0], middles[-1], len(middles)))


def _with_axes(values: FloatArray) -> Any:
    """Return `values` (nz, nx, nt, quantity) as the array with named axes that pysindy needs."""
    from pysindy import AxesArray

    return AxesArray(values, {'ax_spatial': [0, 1], 'ax_time': 2, 'ax_coord': 3})


def _named(features: FloatArray, target: FloatArray, regression: type) -> str:
    """Return the effect of the term with the largest coefficient after the sparse `regression`.

    `features` (domains, terms) and `target` (domains, 1) are normalised before.
    """
    norms = np.linalg.norm(features, axis=0)
    size = float(np.linalg.norm(target))
    if size == 0.0:
        return 'none'
    scaled = features / np.where(norms > 0, norms, 1.0)
    fit = regression(threshold=THRESHOLD, alpha=RIDGE)
    fit.fit(scaled, target / size)
    coefficients = np.asarray(fit.coef_).ravel()
    explained = 1.0 - float(np.sum((target.ravel() / size - scaled @ coefficients) ** 2))
    if explained < LEAST_SHARE or not coefficients.any():
        return 'none'
    return EFFECT_OF_TERM[list(TERMS)[int(np.argmax(np.abs(coefficients)))]]
