"""Findings of the steps of a calibration, as evidence for its judgement."""

from collections.abc import Sequence

import numpy as np

from porotwin_imaging.calibrating.calibration_evidence import PhotographEvidence, SandEvidence
from porotwin_imaging.calibrating.mass_balance_fit import MassLine
from porotwin_imaging.calibrating.plume_core import CORE
from porotwin_imaging.calibrating.response_fit import Dilution, ResponseFit
from porotwin_imaging.calibrating.sands import SandFactors
from porotwin_imaging.calibrating.stock_level import StockLevels


def photograph_evidence(
    times: Sequence[float],
    injected: Sequence[float],
    imaged: Sequence[float],
    cores: Sequence[tuple[float, int]],
    line: MassLine | None,
) -> tuple[PhotographEvidence, ...]:
    """Return the evidence of each photograph.

    `cores`: concentration relative to the injected one, NaN without a core, and cells.
    """
    found = []
    for index, (level, cells) in enumerate(cores):
        reasons = []
        if abs(level - 1.0) > CORE.outlier:
            reasons.append(f'its core is {level:.2f} times the others')
        if line is not None and not line.agree[index]:
            reasons.append(
                f'its mass is {100 * line.distances[index]:+.0f} % of the injection off the line'
            )
        log = injected[index] if injected else float('nan')
        found.append(
            PhotographEvidence(
                times[index], log, imaged[index], level, cells, ' and '.join(reasons)
            )
        )
    return tuple(found)


def core_levels(
    stock: StockLevels, factors: SandFactors, level: float, concentrations: Sequence[float]
) -> list[tuple[float, int]]:
    """Return the level of the reference core of each photograph, 1 if as usual, and its cells."""
    found = []
    for cores, concentration in zip(stock.cores, concentrations, strict=True):
        core = cores.get(factors.reference)
        cells = sum(int(one.cells.sum()) for one in cores.values())
        share = float('nan') if core is None else core.level / (level * concentration)
        found.append((share, cells))
    return found


def sand_evidence(
    stock: StockLevels, factors: SandFactors, names: Sequence[str]
) -> tuple[SandEvidence, ...]:
    """Return how the factor of each sand was found; `names` are those of rig.yaml, by sand."""
    return tuple(
        SandEvidence(
            value,
            deviation,
            source,
            stock.levels[sand].cells if sand in stock.levels else 0,
            pairs,
            at_bound,
            names[sand],
        )
        for sand, (value, deviation, source, pairs, at_bound) in enumerate(
            zip(
                factors.values,
                factors.deviations,
                factors.sources,
                factors.pairs,
                factors.at_bound,
                strict=True,
            )
        )
    )


def dilution_misfit(known: Sequence[Dilution], response: ResponseFit) -> float:
    """Return the largest distance of known dilutions from the curve; NaN without dilutions."""
    if not known:
        return float('nan')
    seen = response.concentration_of(np.array([one.signal for one in known]))
    return float(np.abs(seen - [one.concentration for one in known]).max())


def worst_dilution(
    known: Sequence[Dilution], response: ResponseFit, times: Sequence[tuple[float, float]]
) -> str:
    """Return the dilution farthest from the curve in words, with the times of its photographs.

    `times`: concentration [-] and time [s] of each photograph of a dilution.
    """
    if not known:
        return ''
    seen = response.concentration_of(np.array([one.signal for one in known]))
    worst = int(np.abs(seen - [one.concentration for one in known]).argmax())
    value = known[worst].concentration
    at = ', '.join(f'{time:g} s' for concentration, time in times if concentration == value)
    return f'{value:g} at {at} is read as {seen[worst]:.2f}'
