"""The rival that a user would try first: weak-form sparse regression of the residual, by pysindy.

The one-step residual r = (observed - predicted) / dt is regressed on what the tracer does there:

    r = a1 c + a2 (dc/dt)_model + a3 dc/dx + a4 dc/dz + a5 d2c/dx2 + a6 d2c/dz2

in weak form with sequentially thresholded least squares (Brunton et al., PNAS 113 (2016) 3932;
Messenger & Bortz, J. Comput. Phys. 443 (2021) 110525). The term that explains most of the residual
names an effect; a term cannot name a camera, a well or a place.
"""

from itertools import pairwise
from typing import Any

import numpy as np

from porotwin_core.grid import FloatArray
from porotwin_diagnosis.model.gap_map import observed_maps
from porotwin_recording.recording import Recording
from porotwin_solver.model import Model

EFFECT_OF_TERM = ('decay', 'porosity', 'background_flow', 'buoyancy', 'dispersion', 'dispersion')
"""What a term of the regression would mean, in the order of the equation."""

THRESHOLD = 0.15
"""Terms whose normalised coefficient is below this share are dropped."""

LEAST_SHARE = 0.1
"""Share of the residual's weak energy that the regression must explain to name anything."""

COARSENING, FRAMES, DOMAINS, SEED = 3, 41, 400, 7


def sparse_regression(recording: Recording) -> str:
    """Return the effect that sparse regression names, or `none` where it finds no term."""
    import pysindy

    grid = recording.grid
    coarse = recording.rig.grid(grid.nx // COARSENING, grid.nz // COARSENING)
    times, maps, _ = observed_maps(recording, coarse, FRAMES)
    model = Model(recording.rig, coarse, preset='fast')
    modelled = np.zeros((coarse.nz, coarse.nx, len(times) - 1))
    missing = np.zeros_like(modelled)
    for index, ((start, end), (before, after)) in enumerate(
        zip(pairwise(times), pairwise(maps), strict=True)
    ):
        predicted = before
        for low, high, rates in recording.delivered.intervals(start, end):
            predicted = model.predict(predicted, rates, high - low)
        modelled[:, :, index] = (predicted - before) / (end - start)
        missing[:, :, index] = after - predicted
    middles = 0.5 * (times[1:] + times[:-1])
    even = np.linspace(middles[0], middles[-1], len(middles))
    axes = np.meshgrid(coarse.z, coarse.x, even, indexing='ij')
    library = pysindy.WeakPDELibrary(
        pysindy.PolynomialLibrary(degree=1, include_bias=False),
        derivative_order=2,
        spatiotemporal_grid=np.stack(axes, axis=-1),
        K=DOMAINS,
        H_xt=[0.12 * coarse.height, 0.12 * coarse.width, 0.15 * (even[-1] - even[0])],
    )
    np.random.seed(SEED)  # the library draws its test functions from it
    state = np.stack([np.stack(maps[:-1], axis=-1), modelled], axis=-1)
    wrapped = _wrapped(state)
    library.fit([wrapped])
    features = np.asarray(library.transform([wrapped])[0])
    chosen = _columns(library.get_feature_names(['c', 'm']))
    total = np.cumsum(missing, axis=2)[..., None]
    target = np.asarray(library.convert_u_dot_integral(_wrapped(total)))
    return _named(features[:, chosen], target, pysindy.STLSQ)


def _wrapped(values: FloatArray) -> Any:
    """Return `values` (z, x, time, quantity) as the array with named axes that pysindy wants."""
    from pysindy import AxesArray

    return AxesArray(values, {'ax_spatial': [0, 1], 'ax_time': 2, 'ax_coord': 3})


def _columns(names: list[str]) -> list[int]:
    """Return where c, m, dc/dx, dc/dz, d2c/dx2, d2c/dz2 stand; the library's first axis is z."""
    return [names.index(name) for name in ('c', 'm', 'c_2', 'c_1', 'c_22', 'c_11')]


def _named(features: FloatArray, target: FloatArray, regression: type) -> str:
    """Return the effect of the term that takes most of `target`, after sparse regression."""
    norms = np.linalg.norm(features, axis=0)
    size = float(np.linalg.norm(target))
    if size == 0.0:
        return 'none'
    scaled = features / np.where(norms > 0, norms, 1.0)
    fit = regression(threshold=THRESHOLD, alpha=1e-3)
    fit.fit(scaled, target / size)
    coefficients = np.asarray(fit.coef_).ravel()
    explained = 1.0 - float(np.sum((target.ravel() / size - scaled @ coefficients) ** 2))
    if explained < LEAST_SHARE or not coefficients.any():
        return 'none'
    return EFFECT_OF_TERM[int(np.argmax(np.abs(coefficients)))]
