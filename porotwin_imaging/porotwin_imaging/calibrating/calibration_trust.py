"""The judgement of a calibration: whether it can be trusted, and if not, why.

Three things say how much tracer there is: the pump log, the core of the plume, which is stock, and
the pore volume that the plume fills. A calibration that lets them disagree gives wrong maps with
every photograph. It is refused, with the likely reasons and with the photographs that would help.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.remark import NAMED, Remark
from porotwin_core.basis.units import ML
from porotwin_imaging.baseline.sand_edges import EdgeEvidence
from porotwin_imaging.calibrating.calibration_evidence import (
    CalibrationEvidence,
    PhotographEvidence,
    SandEvidence,
)
from porotwin_imaging.calibrating.mass_balance_fit import MASS_BALANCE
from porotwin_imaging.calibrating.plume_evidence import PlumeEvidence
from porotwin_imaging.calibrating.sands import SANDS


@dataclass(frozen=True)
class TrustSettings:
    """When a calibration is refused, and when a user is told (`calibration_trust.py`).

    Porosity, depth and sorption of a rig are rarely known better than to 10 %, a pump log is.
    """

    most_mass_factor: float = 1.2
    """Largest ratio of injected tracer to that in the plume, or to the pores that it fills where no
    core tells the level of stock, either way [-]. Beyond it the log is of something else."""
    sure_deviations: float = 2.0
    """Standard deviations from which a difference is told [-]."""
    told_share: float = 1 / 3
    """What is refused is told from this share of its limit on [-]."""
    most_offset: float = 0.14
    """Largest tracer at the start of the pump log, relative to the injected [-]."""
    least_hollow: float = 0.6
    """Least signal at the injecting well relative to the level of the plume [-]."""
    least_followers: float = 0.6
    """Least share of photographs that agree with each other [-]."""
    least_strongest: float = 0.85
    """Least concentration of the injected fluid, relative to stock [-]."""
    most_bend: float = 0.17
    """Largest deviation of the response from a straight line at half stock [-]; it may be exceeded
    by its standard deviation. A dye that bends as much in absorbance would lose a third of its
    effect from pale to stock. A tracer that fades bent an injection to 0.172 with a deviation of
    0.05, and the diagnosis of its maps named the decay."""
    most_bend_conflict: float = 0.08
    """Largest difference between the bend by fronts and that by all evidence [-]: three standard
    deviations. Where they agree it is below 0.025."""
    most_dilution_misfit: float = 0.1
    """Largest difference between known and imaged dilutions [-]. Mixing and light cause 0.03."""
    most_apart: float = 0.05
    """Largest distance of a plume from the wells that inject it, relative to the width of the rig
    [-]. Injected tracer begins at its well."""
    most_bow: float = 0.012
    """Largest depth of the frame in the middle of a side, relative to the size of the rig [-]. On
    the large FluidFlower it is 0.022 without the terms of curvature and 0.001 with them."""


TRUST = TrustSettings()


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


_remark = partial(Remark.of, 'calibration')


def refusal(remarks: Sequence[Remark]) -> str:
    """Return the line about the refused things among `remarks`; empty without any."""
    first, *others = (one for one in remarks if one.refused)
    also = f' (also: {"; ".join(one.why for one in others)})' if others else ''
    return f'calibration refused: {first.why}; {first.remedy}{also}'


def judged(
    evidence: CalibrationEvidence,
    plume: PlumeEvidence,
    edges: Sequence[EdgeEvidence] = (),
    cover: Remark | None = None,
) -> tuple[Remark, ...]:
    """Return the remarks about a calibration.

    Those that refuse it come first, the most telling one before the others.

    Args:
        evidence: the findings of the fit.
        plume: place and volume of the plume.
        edges: edges of the sand against the description of the camera.
        cover: sand that the baseline does not show; it explains every other objection.
    """
    found = _objections(evidence, plume, edges)
    if found and cover:
        found = (cover, *found)
    refused = tuple(replace(one, refused=True) for one in found)
    return (*refused, *_odd(evidence, plume))


def _objections(
    evidence: CalibrationEvidence,
    plume: PlumeEvidence,
    edges: Sequence[EdgeEvidence],
) -> tuple[Remark, ...]:
    """Return the reasons to refuse a calibration, the most telling first."""
    hollow = tuple(_hollow(plume))
    amount = tuple(_amount(evidence, plume))
    # tracer in the baseline also makes masses wrong, a wrong well also makes its place pale
    hollow_and_amount = (*amount, *hollow) if plume.is_elsewhere else (*hollow, *amount)
    return tuple(
        itertools.chain(
            _absence(evidence, plume),
            _place(evidence, plume),
            _followers(evidence),
            hollow_and_amount,
            () if hollow else _early_or_late(evidence),
            _sands(evidence.sands),
            _level(evidence, plume),
            _geometry(edges),
        )
    )


def _absence(evidence: CalibrationEvidence, plume: PlumeEvidence) -> Iterator[Remark]:
    """Yield an objection if no plume is seen where the pump log injected one."""
    if evidence.anchor == 'mass' and plume.told_wells and not plume.seen_wells:
        yield _remark(
            'unseen_plume',
            'no plume is seen at well {wells}; likely: a dye that hardly darkens the sand, the '
            'wells in rig.yaml, or photographs of another experiment; photograph an injection of a '
            'dye that is plainly seen',
            wells=' or '.join(plume.told_wells),
        )


def _place(evidence: CalibrationEvidence, plume: PlumeEvidence) -> Iterator[Remark]:
    """Yield an objection if the plume lies away from every well that injects tracer."""
    if plume.apart > TRUST.most_apart:
        yield _remark(
            'misplaced_plume',
            'the plume lies {apart:.0%} of the width of the rig away from well {wells}, which '
            'injects in the pump log{elsewhere}; likely: a baseline that shows tracer already, '
            'photographs that are turned or mirrored, camera.corners_px in another order, the well '
            'in {file}, or the wells in rig.yaml; '
            'correct these until the plume begins at its well, and calibrate again',
            apart=plume.apart,
            wells=' and '.join(plume.told_wells),
            elsewhere=_elsewhere(plume),
            file=evidence.rates_file,
        )


def _amount(evidence: CalibrationEvidence, plume: PlumeEvidence) -> Iterator[Remark]:
    """Yield an objection if plume and pump log do not hold the same amount of tracer."""
    measured = evidence.anchor in ('core', 'dilutions')
    factor = evidence.mass_factor if measured else plume.filled
    if not factor > 0 or abs(math.log(factor)) <= math.log(TRUST.most_mass_factor):
        return
    more = factor < 1
    volumes = f'{ML * plume.fluid:.3g} ml injected'
    if math.isfinite(plume.pore_volume):  # a plume without a core has no volume
        volumes = f'{ML * plume.pore_volume:.0f} ml of pores, {volumes}'
    yield _remark(
        'less_tracer_than_log' if more else 'more_tracer_than_log',
        'the pump log injected {ratio:.2f} times {sense} tracer than the plume holds ({volumes}); '
        'likely: {small}{baseline}rates, unit or times in {file}, stamps of the photographs, '
        '{well}, porosity or depth in rig.yaml{elsewhere}; weigh the stock before and after, '
        'correct {file} or rig.yaml, and calibrate again',
        ratio=1 / factor if more else factor,
        sense='more' if more else 'less',
        volumes=volumes,
        small='' if measured else 'a plume too small to have a core of stock, ',
        baseline='a baseline that shows tracer already, ' if more else '',
        well='a leaking well' if more else 'another well that injects',
        elsewhere=_elsewhere(plume),
        file=evidence.rates_file,
    )


def _elsewhere(plume: PlumeEvidence) -> str:
    """Return words about a plume at another well than the pump log says, empty otherwise."""
    if not plume.is_elsewhere:
        return ''
    seen, told = (' and '.join(wells) for wells in (plume.seen_wells, plume.told_wells))
    return f', while the plume is at well {seen}, and the pump log says {told}'


def _hollow(plume: PlumeEvidence) -> Iterator[Remark]:
    """Yield an objection if the plume is pale where its tracer came from."""
    if plume.hollow < TRUST.least_hollow:
        yield _remark(
            'pale_well',
            'the plume is pale at its own well ({level:.0%} of its level); likely: the baseline '
            'shows tracer already, or water followed the tracer; take the baseline before any '
            'tracer and photograph the injection from its start',
            level=plume.hollow,
        )


def _early_or_late(evidence: CalibrationEvidence) -> Iterator[Remark]:
    """Yield an objection if there was tracer before the injection, or less than none."""
    if abs(evidence.mass_offset) > TRUST.most_offset:
        yield _offset(
            evidence,
            'likely: the clock of the camera against that of the pumps, tracer in the baseline, or '
            'light that drifts; set the clocks, take the baseline just before the injection, and '
            'calibrate again',
        )


def _offset(evidence: CalibrationEvidence, remedy: str) -> Remark:
    """Return the remark about tracer before the injection, or too little after it."""
    early = evidence.mass_offset > 0
    return _remark(
        'tracer_before_log' if early else 'tracer_after_log',
        f'{{share:.0%}} of the tracer is {{sense}} the start of the pump log; {remedy}',
        share=abs(evidence.mass_offset),
        sense='seen before' if early else 'missing from',
    )


def _followers(evidence: CalibrationEvidence) -> Iterator[Remark]:
    """Yield an objection if too few photographs agree.

    It comes before the masses: without one level of stock, they have no scale.
    """
    total, apart = len(evidence.photographs), evidence.disagreeing
    if total and total - len(apart) < TRUST.least_followers * total:
        yield _remark(
            'disagreeing_photographs',
            '{agreeing} of {total} photographs agree ({named}); likely: hands, shadows or '
            'reflections, a moved camera, times in imaging.csv, or cores that get steadily darker '
            '(a dye that stains, water in the tube) or paler (one that fades); photograph the '
            'injection again with steady light and camera, and with fresh stock up to the well',
            agreeing=total - len(apart),
            total=total,
            named=_named(apart),
        )


def _named(photographs: Sequence[PhotographEvidence]) -> str:
    """Return the first photographs with their reasons."""
    named = [f'{one.time:g} s: {one.disagreement}' for one in photographs[:NAMED]]
    more = len(photographs) - len(named)
    return ', '.join(named) + (f', and {more} more' if more > 0 else '')


def _sands(sands: Sequence[SandEvidence]) -> Iterator[Remark]:
    """Yield an objection if a sand needs a factor that no sand has."""
    wrong = {
        number: one.factor
        for number, one in enumerate(sands)
        if one.source != 'prior' and one.at_bound
    }
    if wrong:
        yield _remark(
            'impossible_sands',
            'the same tracer would look {limit:g} times stronger in one sand than in another '
            '({sands}); likely: sands.png takes lamps or tubes for sand, or the corners of the '
            'camera are wrong; correct sands.png or camera.corners_px, or photograph a plume that '
            'fills these sands',
            limit=SANDS.widest_factor,
            sands=', '.join(f'sand {number} x {factor:.2f}' for number, factor in wrong.items()),
            factors=wrong,
        )


def _level(evidence: CalibrationEvidence, plume: PlumeEvidence) -> Iterator[Remark]:
    """Yield objections if the level of stock is not known."""
    if plume.strongest < TRUST.least_strongest:
        yield _remark(
            'no_stock',
            'the injected fluid is {strongest:g} of stock; likely: a dilution, which leaves the '
            'response above it unknown; photograph an injection of stock',
            strongest=plume.strongest,
        )
    if abs(evidence.bend) - evidence.bend_deviation > TRUST.most_bend:
        yield _remark(
            'strong_bend',
            'half of stock would look like {half:.2f} of stock; likely: light that changes during '
            'the injection, the clock of the camera, or tracer in the baseline; photograph the '
            'injection again with steady light, or a dilution of one half',
            half=0.5 + evidence.bend,
        )
    elif evidence.bend_conflict > TRUST.most_bend_conflict:
        yield _fronts(evidence)
    if evidence.dilution_misfit > TRUST.most_dilution_misfit:
        yield _dilution(
            evidence,
            'likely: a dilution that was not mixed, or that is named wrongly; photograph the '
            'dilutions again, each filling a part of the sand',
        )


def _fronts(evidence: CalibrationEvidence) -> Remark:
    """Return the objection that the fronts ask for another response than all evidence."""
    if math.isinf(evidence.bend_conflict):
        finding = (
            'no response that a dye can have fits the fronts: half of stock would look like '
            '{by_fronts:.2f} of stock, at the end of the tried range'
        )
    else:
        finding = (
            'fronts and masses read the response differently: half of stock would look like '
            '{by_fronts:.2f} and {by_masses:.2f} of stock, {apart:.3f} apart (limit {limit:g})'
        )
    bends = evidence.colour_bend
    other = bends.get('difference', math.inf) <= bends.get('absorbance', -math.inf)
    return _remark(
        'conflicting_fronts',
        f'{finding}; likely: a reflection or a hand in a photograph, light that changes, clocks, '
        'the contrast, or a rig that is not as described: tracer that sorbs, a porosity, a depth, '
        'a pump; photograph one dilution (half stock), which needs no fronts'
        f'{_OTHER_CONTRAST if other else ""}; diagnose then names an effect of the rig',
        by_fronts=0.5 + evidence.bend_by_fronts,
        by_masses=0.5 + evidence.bend,
        apart=evidence.bend_conflict,
        limit=TRUST.most_bend_conflict,
        other_contrast=other,
    )


_OTHER_CONTRAST = (
    ', or calibrate with --contrast difference, which keeps the colours of the dye too'
)
"""Fronts are compared in absorbance only, so the other contrast is the difference."""


def _dilution(evidence: CalibrationEvidence, remedy: str) -> Remark:
    """Return the remark about a dilution that is read wrongly, with the worst one if known."""
    worst = evidence.worst_dilution and f' ({evidence.worst_dilution})'
    return _remark(
        'misread_dilution',
        f'a dilution is read {{misfit:.2f}} of stock from its known value{{worst}}; {remedy}',
        misfit=evidence.dilution_misfit,
        worst=worst,
    )


def _geometry(edges: Sequence[EdgeEvidence]) -> Iterator[Remark]:
    """Yield an objection if the sand does not end at the described edges."""
    bent = {one.side: one.bow for one in edges if one.bow > TRUST.most_bow}
    if bent:
        yield _remark(
            'bent_edges',
            'the edge of the sand is bent against rig.yaml ({edges} of the size of the rig); '
            'likely: camera.curvature is missing or wrong, or camera.corners_px; set them until '
            'the edges of 1_geometry.png agree, and calibrate again; docs/rig.md tells how to '
            'measure camera.curvature',
            edges=', '.join(f'{side} edge {bow:.1%}' for side, bow in bent.items()),
            bows=bent,
        )


def _odd(evidence: CalibrationEvidence, plume: PlumeEvidence) -> Iterator[Remark]:
    """Yield the remarks that a user of the maps should know."""
    apart = evidence.mass_factor - 1
    deviation = math.hypot(evidence.mass_factor_deviation, MASS_BALANCE.log_error)
    file = evidence.rates_file
    if evidence.anchor != 'mass' and abs(apart) > TRUST.sure_deviations * deviation:
        yield _remark(
            'more_tracer_than_log' if apart > 0 else 'less_tracer_than_log',
            'the maps hold {share:.0%} {sense} tracer than the pump log; check {file}, porosity '
            'and depth; sorbed tracer is not seen',
            share=abs(apart),
            sense='more' if apart > 0 else 'less',
            file=file,
        )
    if abs(evidence.mass_offset) > TRUST.told_share * TRUST.most_offset:
        yield _offset(evidence, 'check the clock of the camera and the light of the baseline')
    if math.isnan(evidence.mass_factor):
        yield _remark(
            'no_log',
            'no pump log ({file}) says how much tracer the maps should hold; add it to have the '
            'amount checked',
            file=file,
        )
    elif len(evidence.photographs) == 1:
        yield _remark(
            'one_photograph',
            'one photograph cannot show that the tracer in the maps grows as the pump log says; '
            'photograph more of the injection',
        )
    most = TRUST.most_dilution_misfit
    if TRUST.told_share * most < evidence.dilution_misfit <= most:
        yield _dilution(evidence, 'check its concentration in imaging.csv')
    if evidence.anchor == 'mass':
        yield _remark(
            'no_core',
            'no photograph shows a core of stock, so that the scale follows the pump log alone; '
            'photograph a longer injection',
        )
    if plume.is_elsewhere:
        yield _remark(
            'other_well',
            'the plume is at well {seen}, the pump log says {told}; check the well in {file}',
            seen=' and '.join(plume.seen_wells),
            told=' and '.join(plume.told_wells),
            file=file,
        )
    if evidence.bend_deviation > TRUST.told_share * TRUST.most_bend_conflict:
        yield _remark(
            'unsure_response',
            'concentrations between water and stock are uncertain by {deviation:.2f}; photograph a '
            'dilution of one half',
            deviation=evidence.bend_deviation,
        )
