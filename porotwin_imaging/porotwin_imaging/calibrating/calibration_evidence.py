"""The evidence behind a calibration: the findings in its photographs, before any judgement."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from porotwin_imaging.calibrating.front_response import FrontFit

Anchor = Literal['dilutions', 'core', 'mass', 'strongest signal']
"""Where the level of tracer stock comes from: photographs of known dilutions, the core of the
injected plume, the mass of the pump log, or the strongest signal."""
FactorSource = Literal['core', 'same sand', 'interface', 'prior']
"""Where the factor of a sand comes from: its core, a core in the same sand at another place, the
signal across its interfaces, or the appearance of its grains."""

SOURCES: dict[FactorSource, str] = {
    'core': 'seen: the core of a plume',
    'interface': 'seen: a plume across its interface',
    'same sand': 'from its core at another place',
    'prior': 'guessed from its brightness: no plume there',
}
"""How each source is named to a person."""

RATES_FILE = 'rates.csv'
"""File with the commanded rates, which messages name unless other rates were used."""
SURE_END = 0.03
"""Standard deviation of the bend by fronts [-] below which a bend at the end of the tried range is
sure. Fronts that fit the model have 0.015 to 0.03; with 0.04 and more they fit several bends."""

_ANCHORS: dict[Anchor, str] = {
    'dilutions': 'photographs of known dilutions',
    'core': 'the core of the plume',
    'mass': 'the mass of the pump log, because no plume has an even core',
    'strongest signal': 'the strongest signal: there is neither an even core nor a pump log',
}
"""How each anchor is named to a person."""


@dataclass(frozen=True)
class SandEvidence:
    """How the factor of one sand was found.

    Attributes:
        factor: factor on the signal of this sand [-].
        deviation: relative standard deviation of `factor` [-].
        source: where the factor comes from.
        core_cells: cells with the core of a plume in this sand, over all photographs.
        pairs: pairs of cells across its interfaces.
        at_bound: True if the photographs ask for a factor outside the bounds.
        name: its name in rig.yaml; empty if it has none.
    """

    factor: float
    deviation: float
    source: FactorSource
    core_cells: int
    pairs: int
    at_bound: bool
    name: str = ''

    def label(self, number: int) -> str:
        """Return its `number` in sands.png, with its name."""
        return f'{number} ({self.name})' if self.name else str(number)


@dataclass(frozen=True)
class PhotographEvidence:
    """The evidence of one photograph.

    Attributes:
        time: exposure time [s].
        injected: volume of stock that the pumps injected before it [m^3]; NaN without a pump log.
        imaged: volume of stock in its map [m^3].
        core_level: concentration in the core of its plume [-]; NaN without a core.
        core_cells: cells of the core.
        disagreement: why it disagrees with the others, empty if it does not.
    """

    time: float
    injected: float
    imaged: float
    core_level: float
    core_cells: int
    disagreement: str = ''


@dataclass(frozen=True)
class CalibrationEvidence:
    """The evidence of photographs, pump log and dilutions about a calibration.

    Attributes:
        anchor: where the level of tracer stock comes from.
        photographs: one entry per photograph that was used, in the order of time.
        sands: one entry per sand.
        bend: deviation of the response from a straight line at half stock [-], concentration.
        bend_deviation: standard deviation of `bend` [-].
        colour_bend: by contrast, how far the ratio of the channels changes from pale to stock,
            relative; the contrast that describes the dye keeps the ratio.
        mass_factor: imaged over injected volume, fitted with an offset; 1 if log and anchor agree.
            NaN without a pump log.
        mass_factor_deviation: standard deviation of `mass_factor`, by the photographs and by the
            stated errors of the calibration (`Calibration.mass_deviation`).
        mass_offset: imaged volume at zero injection, relative to the largest injected volume.
        mass_misfit: root mean square distance of the photographs from that line, relative to the
            largest injected volume.
        fronts: the fronts beside those of a model; None if they were not compared.
        dilution_misfit: largest difference between known and imaged dilutions [-]; NaN without.
        worst_dilution: the dilution with that difference, its photographs and what is read from it.
        rates_file: name of the file with the injected rates, for messages.
    """

    anchor: Anchor
    photographs: tuple[PhotographEvidence, ...]
    sands: tuple[SandEvidence, ...]
    bend: float
    bend_deviation: float
    colour_bend: dict[str, float]
    mass_factor: float
    mass_factor_deviation: float
    mass_offset: float
    mass_misfit: float
    dilution_misfit: float
    fronts: FrontFit | None = None
    worst_dilution: str = ''
    rates_file: str = RATES_FILE

    @property
    def bend_by_fronts(self) -> float:
        """Bend that the fronts show [-]; NaN if they were not compared."""
        return self.fronts.bend if self.fronts else float('nan')

    @property
    def bend_conflict(self) -> float:
        """Bend minus the bend of the fronts [-]; 0 with dilutions or no fronts.

        It is infinite if the fronts surely ask for a bend beyond all that are tried.
        """
        if np.isfinite(self.dilution_misfit) or self.fronts is None:
            return 0.0
        if self.fronts.at_end and self.fronts.deviation < SURE_END:
            return float('inf')
        return abs(self.bend - self.fronts.bend)

    @property
    def disagreeing(self) -> tuple[PhotographEvidence, ...]:
        """The photographs that disagree with the others."""
        return tuple(one for one in self.photographs if one.disagreement)


def evidence_lines(evidence: CalibrationEvidence) -> list[str]:
    """Return a summary for the operator, one line per kind of evidence."""
    lines = [_sand_line(evidence), _stock_line(evidence), _response_line(evidence)]
    if np.isfinite(evidence.mass_factor):
        lines.append(_mass_line(evidence))
    lines += [f'photograph at {one.time:g} s: {one.disagreement}' for one in evidence.disagreeing]
    return lines


def _sand_line(evidence: CalibrationEvidence) -> str:
    if len(evidence.sands) == 1:
        return 'sands: one'
    words = ', '.join(
        f'sand {one.label(number)} {one.factor:.2f} +- {one.factor * one.deviation:.2f} '
        f'({SOURCES[one.source]})'
        for number, one in enumerate(evidence.sands)
    )
    guessed = [one.label(n) for n, one in enumerate(evidence.sands) if one.source == 'prior']
    warning = (
        f'; sand {", ".join(guessed)} not reached by the plume (4_sands.png shows where)'
        if guessed
        else ''
    )
    return f'sands: {len(evidence.sands)} (grey levels of sands.png), factors {words}{warning}'


def _stock_line(evidence: CalibrationEvidence) -> str:
    line = f'tracer stock: from {_ANCHORS[evidence.anchor]}'
    cored = [one for one in evidence.photographs if one.core_cells]
    if evidence.anchor == 'core':
        line += f'; {len(cored)} of {len(evidence.photographs)} photographs have one'
    if np.isfinite(evidence.dilution_misfit):
        line += f'; known dilutions are met to {evidence.dilution_misfit:.3f}'
    return line


def _response_line(evidence: CalibrationEvidence) -> str:
    line = (
        f'response: {evidence.bend:+.3f} +- {evidence.bend_deviation:.3f} off '
        'the straight line at half stock'
    )
    fronts = evidence.fronts
    if fronts is None:
        return line
    return (
        f'{line}; the fronts beside a model of the flow say {fronts.bend:+.3f} +- '
        f'{fronts.deviation:.3f}, and the camera blurs by {fronts.blur_px:.1f} px'
    )


def _mass_line(evidence: CalibrationEvidence) -> str:
    count = len(evidence.photographs)
    checked = (
        f'{count - len(evidence.disagreeing)} of {count} photographs agree to '
        f'{100 * evidence.mass_misfit:.1f} %'
        if count > 1
        else 'one photograph alone, so none confirms it'
    )
    return (
        f'mass: {checked}; the maps hold {evidence.mass_factor:.3f} +- '
        f'{evidence.mass_factor_deviation:.3f} times the injected mass, '
        f'{100 * evidence.mass_offset:+.1f} % of it before the injection'
    )
