"""The judgement of a calibration: whether it can be trusted, and if not, why.

Three things say how much tracer there is: the pump log, the core of the plume, which is stock, and
the pore volume that the plume fills. A calibration that lets them disagree gives wrong maps with
every photograph. It is refused, with the likely reasons and with the photographs that would help.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import ML
from porotwin_imaging.baseline.covered_baseline import REASONS, REMEDY, Cover
from porotwin_imaging.baseline.sand_edges import EdgeEvidence
from porotwin_imaging.calibrating.calibration_evidence import (
    CalibrationEvidence,
    PhotographEvidence,
    SandEvidence,
)
from porotwin_imaging.calibrating.core_trend import TRUST, CoreTrend, core_trend
from porotwin_imaging.calibrating.plume_evidence import PlumeEvidence

_NAMED_PHOTOGRAPHS = 3
"""Photographs named in a line; more would hide the reason."""


class CalibrationRefused(InputError):  # noqa: N818  a state of the work
    """The photographs do not make a calibration that can be trusted; the message is one line.

    Attributes:
        lines: remarks about the photographs until the refusal, for the operator.
        picture: the picture that shows why; None if the refusal came before the pictures.
    """

    def __init__(
        self, message: str, lines: Sequence[str] = (), picture: Path | None = None
    ) -> None:
        """Keep the one-line `message` and the evidence."""
        super().__init__(message)
        self.lines = tuple(lines)
        self.picture = picture


@dataclass(frozen=True)
class Objection:
    """A reason not to trust a calibration.

    Attributes:
        finding: the disagreement, with its figures.
        reasons: the likely reasons.
        remedy: the photograph or the check that would mend it.
    """

    finding: str
    reasons: str
    remedy: str

    def __str__(self) -> str:
        return f'{self.finding}; likely: {self.reasons}; {self.remedy}'


@dataclass(frozen=True)
class Trust:
    """The judgement of a calibration.

    Attributes:
        objections: reasons to refuse it, the most telling first; empty if it can be trusted.
        remarks: lines that a user of its maps should know.
    """

    objections: tuple[Objection, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def refusal(self) -> str:
        """The objections in one line; empty if the calibration can be trusted."""
        if not self.objections:
            return ''
        first, *others = self.objections
        also = f' (also: {"; ".join(one.finding for one in others)})' if others else ''
        return f'calibration refused: {first}{also}'


def judged(
    evidence: CalibrationEvidence,
    plume: PlumeEvidence,
    edges: Sequence[EdgeEvidence] = (),
    cover: Cover | None = None,
) -> Trust:
    """Return the judgement of a calibration.

    Args:
        evidence: the findings of the fit.
        plume: place and volume of the plume.
        edges: edges of the sand against the description of the camera.
        cover: sand that the baseline does not show; it explains every other objection.
    """
    objections = _objections(evidence, plume, edges)
    if objections and cover:
        objections = (Objection(cover.finding, REASONS, REMEDY), *objections)
    return Trust(objections, tuple(_remarks(evidence, plume)))


def _objections(
    evidence: CalibrationEvidence,
    plume: PlumeEvidence,
    edges: Sequence[EdgeEvidence],
) -> tuple[Objection, ...]:
    """Return the objections to a calibration, the most telling first."""
    hollow = tuple(_hollow(plume))
    amount = tuple(_amount(evidence, plume))
    # tracer in the baseline also makes masses wrong, a wrong well also makes its place pale
    hollow_and_amount = (*amount, *hollow) if _elsewhere(plume) else (*hollow, *amount)
    return tuple(
        itertools.chain(
            _absence(evidence, plume),
            _place(evidence, plume),
            _changing_cores(evidence),
            hollow_and_amount,
            () if hollow else _early_or_late(evidence),
            _followers(evidence),
            _sands(evidence.sands),
            _level(evidence, plume),
            _geometry(edges),
        )
    )


def _absence(evidence: CalibrationEvidence, plume: PlumeEvidence) -> Iterator[Objection]:
    """Yield an objection if no plume is seen where the pump log injected one."""
    if evidence.anchor == 'mass' and plume.told_wells and not plume.seen_wells:
        yield Objection(
            f'no plume is seen at well {" or ".join(plume.told_wells)}',
            'a dye that hardly darkens the sand, the wells in rig.yaml, or photographs of another '
            'experiment',
            'photograph an injection of a dye that is plainly seen',
        )


def _place(evidence: CalibrationEvidence, plume: PlumeEvidence) -> Iterator[Objection]:
    """Yield an objection if the plume lies away from every well that injects tracer."""
    if plume.apart > TRUST.most_apart:
        yield Objection(
            f'the plume lies {100 * plume.apart:.0f} % of the width of the rig away from well '
            f'{" and ".join(plume.told_wells)}, which injects in the pump log'
            f'{_elsewhere(plume)}',
            'photographs that are turned or mirrored, camera.corners_px in another order, the well '
            f'in {evidence.rates_file}, or the wells in rig.yaml',
            'correct these until the plume begins at its well, and calibrate again',
        )


def _amount(evidence: CalibrationEvidence, plume: PlumeEvidence) -> Iterator[Objection]:
    """Yield an objection if plume and pump log do not hold the same amount of tracer."""
    measured = evidence.anchor in ('core', 'dilutions')
    factor = evidence.mass_factor if measured else plume.filled
    allowed = TRUST.most_mass_factor if measured else TRUST.most_filled_factor
    if not factor > 0 or abs(math.log(factor)) <= math.log(allowed):
        return
    more = factor < 1
    ratio = 1 / factor if more else factor
    volumes = f'{ML * plume.fluid:.3g} ml injected'
    if math.isfinite(plume.pore_volume):  # a plume without a core has no volume
        volumes = f'{ML * plume.pore_volume:.0f} ml of pores, {volumes}'
    wells = _elsewhere(plume)
    small = '' if measured else 'a plume too small to have a core of stock, '
    yield Objection(
        f'the pump log injected {ratio:.2f} times {"more" if more else "less"} tracer than the '
        f'plume holds ({volumes})',
        f'{small}rates, unit or times in {evidence.rates_file}, stamps of the photographs, '
        f'{"a leaking well" if more else "another well that injects"}, porosity or depth in '
        f'rig.yaml{wells}',
        f'weigh the stock before and after, correct {evidence.rates_file} or rig.yaml, and '
        'calibrate again',
    )


def _elsewhere(plume: PlumeEvidence) -> str:
    """Return words about a plume at another well than the pump log says, empty otherwise."""
    if (
        not plume.told_wells
        or not plume.seen_wells
        or set(plume.told_wells) & set(plume.seen_wells)
    ):
        return ''
    return (
        f'; the plume is at well {" and ".join(plume.seen_wells)}, the pump log says '
        f'{" and ".join(plume.told_wells)}'
    )


def _hollow(plume: PlumeEvidence) -> Iterator[Objection]:
    """Yield an objection if the plume is pale where its tracer came from."""
    if plume.hollow < TRUST.least_hollow:
        yield Objection(
            f'the plume is pale at its own well ({100 * plume.hollow:.0f} % of its level)',
            'the baseline shows tracer already, or water followed the tracer',
            'take the baseline before any tracer and photograph the injection from its start',
        )


def _early_or_late(evidence: CalibrationEvidence) -> Iterator[Objection]:
    """Yield an objection if there was tracer before the injection, or less than none."""
    if abs(evidence.mass_offset) > TRUST.most_offset:
        early = evidence.mass_offset > 0
        yield Objection(
            f'{100 * abs(evidence.mass_offset):.0f} % of the tracer is '
            f'{"seen before" if early else "missing from"} the start of the pump log',
            'the clock of the camera against that of the pumps, tracer in the baseline, or light '
            'that drifts',
            'set the clocks, take the baseline just before the injection, and calibrate again',
        )


def _too_few_agree(evidence: CalibrationEvidence) -> bool:
    """Return whether too few photographs agree with each other."""
    total, apart = len(evidence.photographs), len(evidence.disagreeing)
    return total > 0 and (total - apart) / total < TRUST.least_followers


def _changing_cores(evidence: CalibrationEvidence) -> Iterator[Objection]:
    """Yield an objection if photographs disagree because the cores change steadily in time.

    It comes before the masses: without one level of stock, they have no scale.
    """
    trend = core_trend(evidence.photographs)
    if trend is not None and _too_few_agree(evidence):
        yield _rising(trend, evidence.rates_file) if trend.rises else _falling(trend)


def _rising(trend: CoreTrend, rates_file: str) -> Objection:
    """Return the objection that the cores get darker in time."""
    return Objection(
        f'the core of the plume gets steadily darker ({_course(trend)})',
        'dye that stays on the sand (sorption, a stain), first stock that water in the tube '
        f'diluted, or stock that is stronger later than in {rates_file}',
        'flush with clean water and photograph: colour that is left is a stain, and needs another '
        'dye; otherwise fill the tube with stock up to the well, inject again, and photograph a '
        'known dilution',
    )


def _falling(trend: CoreTrend) -> Objection:
    """Return the objection that the cores get paler in time."""
    return Objection(
        f'the core of the plume gets steadily paler ({_course(trend)})',
        'tracer that fades, light that drifts, or water that enters',
        'inject fresh stock and photograph: if it is pale too, keep the light steady; if '
        'not, stop all pumps: a core that still gets paler fades, and needs another dye',
    )


def _course(trend: CoreTrend) -> str:
    """Return the first and the last level of the cores with their times."""
    first, last = trend.first, trend.last
    return (
        f'{first.core_level:.2f} of stock at {first.time:.0f} s, {last.core_level:.2f} at '
        f'{last.time:.0f} s'
    )


def _followers(evidence: CalibrationEvidence) -> Iterator[Objection]:
    """Yield objections if too few photographs agree, or agree too loosely."""
    total, apart = len(evidence.photographs), evidence.disagreeing
    if _too_few_agree(evidence):
        if core_trend(evidence.photographs) is None:
            yield Objection(
                f'{total - len(apart)} of {total} photographs agree ({_named(apart)})',
                'hands, shadows or reflections, a moved camera, or times in imaging.csv',
                'photograph the injection again with steady light and camera',
            )
    elif evidence.mass_misfit > TRUST.most_mass_misfit:
        yield Objection(
            f'the tracer in the photographs scatters by {100 * evidence.mass_misfit:.0f} % about '
            'the pump log',
            'unsteady pumps, times in imaging.csv, or light that changes',
            'photograph an injection at one constant rate with steady light',
        )


def _named(photographs: Sequence[PhotographEvidence]) -> str:
    """Return the first photographs with their reasons."""
    named = [f'{one.time:g} s: {one.disagreement}' for one in photographs[:_NAMED_PHOTOGRAPHS]]
    more = len(photographs) - len(named)
    return '; '.join(named) + (f'; and {more} more' if more > 0 else '')


def _sands(sands: Sequence[SandEvidence]) -> Iterator[Objection]:
    """Yield an objection if a sand needs a factor that no sand has."""
    wrong = [
        f'sand {number} x {one.factor:.2f}'
        for number, one in enumerate(sands)
        if one.source != 'prior' and (one.at_bound or not _plausible(one.factor))
    ]
    if wrong:
        yield Objection(
            f'the same tracer would look {TRUST.most_factor:g} times stronger in one sand than '
            f'in another ({", ".join(wrong)})',
            'sands.png takes lamps or tubes for sand, or the corners of the camera are wrong',
            'correct sands.png or camera.corners_px, or photograph a plume that fills these sands',
        )


def _plausible(factor: float) -> bool:
    """Return whether a sand may have this factor."""
    return 1 / TRUST.most_factor <= factor <= TRUST.most_factor


def _level(evidence: CalibrationEvidence, plume: PlumeEvidence) -> Iterator[Objection]:
    """Yield objections if the level of stock is not known."""
    if plume.strongest < TRUST.least_strongest:
        yield Objection(
            f'the injected fluid is {plume.strongest:g} of stock',
            'a dilution, which leaves the response above it unknown',
            'photograph an injection of stock',
        )
    if abs(evidence.bend) - evidence.bend_deviation > TRUST.most_bend:
        yield Objection(
            f'half of stock would look like {0.5 + evidence.bend:.2f} of stock',
            'light that changes during the injection, the clock of the camera, or tracer in the '
            'baseline',
            'photograph the injection again with steady light, or a dilution of one half',
        )
    elif evidence.bend_conflict > TRUST.most_bend_conflict:
        yield _fronts(evidence)
    if evidence.core_flatness > TRUST.most_core_slope:
        yield Objection(
            f'the core of the plume is not even: {100 * evidence.core_flatness:.0f} % from its '
            'inner to its outer half',
            'an injection too short to fill the pores, a reflection, or a dye that fades',
            'inject stock until the plume is some 10 cm wide, and photograph it with even light',
        )
    if evidence.dilution_misfit > TRUST.most_dilution_misfit:
        yield Objection(
            f'a dilution is read {evidence.dilution_misfit:.2f} of stock from its known value'
            f'{_of_dilution(evidence)}',
            'a dilution that was not mixed, or that is named wrongly',
            'photograph the dilutions again, each filling a part of the sand',
        )


def _fronts(evidence: CalibrationEvidence) -> Objection:
    """Return the objection that the fronts ask for another response than all evidence."""
    by_fronts = f'{0.5 + evidence.bend_by_fronts:.2f}'
    if math.isinf(evidence.bend_conflict):
        finding = (
            'no response that a dye can have fits the fronts: half of stock would look like '
            f'{by_fronts} of stock, at the end of what is tried'
        )
    else:
        finding = (
            f'fronts and masses read the response differently: half of stock would look like '
            f'{by_fronts} and {0.5 + evidence.bend:.2f} of stock, {evidence.bend_conflict:.3f} '
            f'apart (limit {TRUST.most_bend_conflict:g})'
        )
    return Objection(
        finding,
        'a reflection or a hand in a photograph, light that changes, clocks, the contrast, or '
        'a rig that is not as described: tracer that sorbs, a porosity, a depth, a pump',
        f'photograph one dilution (half stock), which needs no fronts{_other_contrast(evidence)}; '
        'diagnose then names an effect of the rig',
    )


def _other_contrast(evidence: CalibrationEvidence) -> str:
    """Return the other contrast as a remedy if it keeps the colours of the dye as well.

    Fronts are compared in absorbance only, so the other contrast is the difference.
    """
    bends = evidence.colour_bend
    if bends.get('difference', math.inf) <= bends.get('absorbance', -math.inf):
        return ', or calibrate with --contrast difference, which keeps the colours of the dye too'
    return ''


def _of_dilution(evidence: CalibrationEvidence) -> str:
    """Return the dilution that disagrees most in brackets; empty if it is not known."""
    return f' ({evidence.worst_dilution})' if evidence.worst_dilution else ''


def _geometry(edges: Sequence[EdgeEvidence]) -> Iterator[Objection]:
    """Yield an objection if the sand does not end at the described edges."""
    bent = [one for one in edges if one.bow > TRUST.most_bow]
    if bent:
        words = ', '.join(f'{one.side} edge {100 * one.bow:.1f} %' for one in bent)
        yield Objection(
            f'the edge of the sand is bent against rig.yaml ({words} of the size of the rig)',
            'camera.curvature is missing or wrong, or camera.corners_px',
            'set them until the edges of 1_geometry.png agree, and calibrate again; docs/rig.md '
            'tells how to measure camera.curvature',
        )


def _remarks(evidence: CalibrationEvidence, plume: PlumeEvidence) -> Iterator[str]:
    """Yield the lines of a calibration that can be trusted."""
    apart = evidence.mass_factor - 1
    sure = TRUST.sure_deviations * evidence.mass_factor_deviation
    if evidence.anchor != 'mass' and abs(apart) > max(TRUST.told_mass_error, sure):
        yield (
            f'the maps hold {100 * abs(apart):.0f} % {"more" if apart > 0 else "less"} tracer than '
            f'the pump log: check {evidence.rates_file}, porosity and depth; sorbed tracer is not '
            'seen'
        )
    if abs(evidence.mass_offset) > TRUST.told_offset:
        yield (
            f'{100 * abs(evidence.mass_offset):.0f} % of the tracer is '
            f'{"seen before" if evidence.mass_offset > 0 else "missing from"} the start of the '
            'pump log: check the clock of the camera and the light of the baseline'
        )
    if math.isnan(evidence.mass_factor):
        yield 'no pump log (rates.csv): the amount of tracer in the maps was not checked'
    elif len(evidence.photographs) == 1:
        yield (
            'one photograph cannot show that the tracer in the maps grows as the pump log says: '
            'photograph more of the injection'
        )
    if TRUST.told_dilution_misfit < evidence.dilution_misfit <= TRUST.most_dilution_misfit:
        yield (
            f'a dilution is read {evidence.dilution_misfit:.2f} of stock from its known value'
            f'{_of_dilution(evidence)}: check its concentration in imaging.csv'
        )
    if evidence.anchor == 'mass':
        yield 'no photograph shows a core of stock: the scale follows the pump log alone'
    if wells := _elsewhere(plume):
        yield wells.removeprefix('; ') + f': check the well in {evidence.rates_file}'
    if evidence.bend_deviation > TRUST.told_bend_deviation:
        yield (
            f'concentrations between water and stock are uncertain by {evidence.bend_deviation:.2f}'
            ': photograph a dilution of one half'
        )
