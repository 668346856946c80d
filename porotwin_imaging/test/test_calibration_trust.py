"""Whether a calibration is trusted: each disagreement is named, and good ones pass."""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from porotwin_core.basis.remark import Remark
from porotwin_imaging.baseline.sand_edges import EdgeEvidence
from porotwin_imaging.calibrating.calibration_evidence import (
    CalibrationEvidence,
    PhotographEvidence,
    SandEvidence,
    evidence_lines,
)
from porotwin_imaging.calibrating.calibration_trust import judged, refusal
from porotwin_imaging.calibrating.front_response import FrontFit
from porotwin_imaging.calibrating.plume_evidence import PlumeEvidence

NAN = float('nan')
SAND = SandEvidence(1.0, 0.02, 'core', 400, 60, at_bound=False)
PHOTOGRAPHS = tuple(
    PhotographEvidence(300.0 * n, 1.5e-4 * n, 1.5e-4 * n, 1.0, 200) for n in range(1, 8)
)
GOOD = CalibrationEvidence(
    anchor='core',
    photographs=PHOTOGRAPHS,
    sands=(SAND, replace(SAND, factor=1.4)),
    bend=0.03,
    bend_deviation=0.01,
    colour_bend={},
    mass_factor=1.0,
    mass_factor_deviation=0.01,
    mass_offset=0.0,
    mass_misfit=0.005,
    dilution_misfit=NAN,
)
PLUME = PlumeEvidence(1.05e-3, 1.05e-3, 1.0, ('upper',), ('upper',), 1.0, 0.0)


def told(
    evidence: CalibrationEvidence = GOOD, plume: PlumeEvidence = PLUME, edges=(), *, refused=False
) -> dict[str, Mapping[str, Any]]:
    """Return the facts of the remarks by their codes; only of the objections if `refused`."""
    remarks = judged(evidence, plume, edges)
    return {one.code: one.facts for one in remarks if one.refused or not refused}


objections = partial(told, refused=True)


def test_a_calibration_whose_evidence_agrees_is_trusted_without_a_remark() -> None:
    assert judged(GOOD, PLUME) == ()


def test_a_covered_baseline_is_the_first_reason_but_none_of_its_own() -> None:
    cover = Remark('baseline', '', 'it is covered', 'take another', code='covered_baseline')
    assert judged(GOOD, PLUME, cover=cover) == ()
    remarks = judged(replace(GOOD, mass_factor=0.3), PLUME, cover=cover)
    assert [one.code for one in remarks if one.refused] == [cover.code, 'less_tracer_than_log']


def test_a_refusal_is_one_line_with_the_first_remedy_and_all_findings() -> None:
    line = refusal(judged(replace(GOOD, mass_factor=3.0, bend=-0.24), PLUME))
    first, second = judged(replace(GOOD, mass_factor=3.0, bend=-0.24), PLUME)[:2]
    assert line == f'calibration refused: {first.why}; {first.remedy} (also: {second.why})'
    assert '\n' not in line


def test_fronts_that_contradict_the_masses_are_refused_unless_a_dilution_decides() -> None:
    fronts = FrontFit(-0.15, 0.02, 1.3, 0.0, 0.01)
    facts = objections(replace(GOOD, fronts=fronts))['conflicting_fronts']
    assert facts['by_fronts'] == pytest.approx(0.35) and facts['by_masses'] == pytest.approx(0.53)
    assert not objections(replace(GOOD, fronts=fronts, dilution_misfit=0.01))
    agreeing = replace(fronts, bend=0.04)
    assert not objections(replace(GOOD, fronts=agreeing))
    assert 'conflicting_fronts' in objections(replace(GOOD, fronts=replace(agreeing, at_end=True)))


def test_fronts_that_fit_many_bends_refuse_no_good_injection() -> None:
    unsure = FrontFit(-0.145, 0.042, 1.0, 0.0, 0.033, at_end=True)
    assert not objections(replace(GOOD, bend=-0.12, fronts=unsure))
    assert 'conflicting_fronts' in objections(replace(GOOD, bend=-0.05, fronts=unsure))


@pytest.mark.parametrize(('deviation', 'is_refused'), [(0.05, False), (0.01, True)])
def test_a_strong_bend_is_refused_only_if_it_is_sure(deviation: float, is_refused: bool) -> None:
    found = objections(replace(GOOD, bend=0.19, bend_deviation=deviation))
    assert ('strong_bend' in found) == is_refused


def test_a_conflict_of_fronts_shows_its_limit_where_figures_round_to_the_same_text() -> None:
    beyond = replace(GOOD, bend=-0.142, fronts=FrontFit(-0.145, 0.02, 1.3, 0.0, 0.01, at_end=True))
    assert '0.36 and 0.36' not in refusal(judged(beyond, PLUME))
    apart = replace(GOOD, bend=0.0301, fronts=FrontFit(-0.0509, 0.02, 1.3, 0.0, 0.01))
    assert '0.081 apart (limit 0.08)' in refusal(judged(apart, PLUME))


@pytest.mark.parametrize(('difference', 'named'), [(0.05, True), (0.3, False), (NAN, False)])
def test_the_other_contrast_is_a_remedy_only_if_it_keeps_the_colours(difference, named) -> None:
    fronts = FrontFit(-0.15, 0.02, 1.3, 0.0, 0.01)
    colours = {'absorbance': 0.12, 'difference': difference}
    found = objections(replace(GOOD, fronts=fronts, colour_bend=colours))
    assert found['conflicting_fronts']['other_contrast'] == named


@pytest.mark.parametrize(
    ('factor', 'code', 'ratio'),
    [
        (1 / 3, 'less_tracer_than_log', 3.0), (3.0, 'more_tracer_than_log', 3.0),
        (0.77, 'less_tracer_than_log', 1 / 0.77), (1.3, 'more_tracer_than_log', 1.3),
    ],
)  # fmt: skip
def test_a_pump_log_that_is_wrong_is_refused_with_its_file(factor, code, ratio) -> None:
    facts = objections(replace(GOOD, mass_factor=factor, rates_file='rates_measured.csv'))[code]
    assert facts['ratio'] == pytest.approx(ratio)
    assert facts['file'] == 'rates_measured.csv'


@pytest.mark.parametrize('factor', [0.89, 0.93, 1.1])
def test_sorption_or_a_porosity_off_by_ten_percent_is_told_and_not_refused(factor) -> None:
    evidence = replace(GOOD, mass_factor=factor)
    assert not objections(evidence)
    code = 'more_tracer_than_log' if factor > 1 else 'less_tracer_than_log'
    assert told(evidence)[code]['share'] == pytest.approx(abs(factor - 1))


def test_a_small_uncertain_difference_is_not_told() -> None:
    uncertain = replace(GOOD, mass_factor=1.05, mass_factor_deviation=0.05)
    assert not told(uncertain)


def test_without_a_core_the_filled_pores_judge_the_pump_log() -> None:
    by_mass = replace(GOOD, anchor='mass', mass_factor=1.0)
    assert 'less_tracer_than_log' in objections(by_mass, replace(PLUME, pore_volume=3.5e-4))
    assert 'more_tracer_than_log' in objections(by_mass, replace(PLUME, pore_volume=3.1e-3))
    unknown = judged(replace(GOOD, mass_factor=9.0), replace(PLUME, pore_volume=math.nan))
    assert 'nan' not in refusal(unknown)
    assert [*told(by_mass)] == ['no_core']
    assert not objections(by_mass)


def test_a_dye_that_is_not_seen_is_named_first() -> None:
    unseen = replace(PLUME, seen_wells=(), pore_volume=3e-4)
    found = objections(replace(disagreeing(7), anchor='mass'), unseen)
    assert next(iter(found.items())) == ('unseen_plume', {'wells': 'upper'})


def test_without_a_pump_log_there_is_nothing_to_compare() -> None:
    alone = replace(GOOD, anchor='strongest signal', mass_factor=NAN, mass_offset=NAN)
    plume = replace(PLUME, fluid=NAN, strongest=NAN, told_wells=())
    assert [*told(replace(alone, mass_misfit=NAN), plume)] == ['no_log']


def test_one_photograph_does_not_agree_with_itself() -> None:
    one = replace(GOOD, photographs=PHOTOGRAPHS[:1], mass_misfit=0.0)
    assert not objections(one) and 'one_photograph' in told(one)
    mass = next(line for line in evidence_lines(one) if line.startswith('mass:'))
    assert 'agree' not in mass


def test_the_evidence_of_every_sand_is_told_in_words() -> None:
    sands = (SAND, replace(SAND, source='prior', deviation=0.2))
    line = evidence_lines(replace(GOOD, sands=sands))[0]
    assert '(seen: the core of a plume)' in line
    assert '(guessed from its brightness: no plume there)' in line


def test_a_baseline_with_tracer_is_named_before_the_masses() -> None:
    assert 'pale_well' in objections(replace(GOOD, mass_offset=-0.2), replace(PLUME, hollow=0.1))
    found = objections(replace(GOOD, mass_factor=0.5), replace(PLUME, hollow=0.0))
    assert [*found] == ['pale_well', 'less_tracer_than_log']


@pytest.mark.parametrize(
    ('offset', 'code'), [(0.2, 'tracer_before_log'), (-0.2, 'tracer_after_log')]
)
def test_tracer_before_the_injection_is_explained(offset, code) -> None:
    assert code in objections(replace(GOOD, mass_offset=offset))
    half = replace(GOOD, mass_offset=offset / 2)
    assert not objections(half) and code in told(half)


def disagreeing(count: int) -> CalibrationEvidence:
    some = [replace(one, disagreement='a shadow') for one in PHOTOGRAPHS[:count]]
    return replace(GOOD, photographs=(*some, *PHOTOGRAPHS[count:]))


def test_most_photographs_must_agree_and_the_others_are_named() -> None:
    assert not objections(disagreeing(2))
    facts = objections(disagreeing(4))['disagreeing_photographs']
    assert (facts['agreeing'], facts['total']) == (3, 7)
    assert facts['named'].startswith('300 s: a shadow, ')


def with_cores(*levels: float) -> CalibrationEvidence:
    some = [
        replace(one, core_level=level, disagreement='' if abs(level - 1) < 0.04 else 'its core')
        for one, level in zip(PHOTOGRAPHS, levels, strict=True)
    ]
    return replace(GOOD, photographs=tuple(some), rates_file='rates_measured.csv')


def test_changing_cores_come_before_the_masses_that_follow_from_them() -> None:
    stained = with_cores(0.47, 0.71, 0.86, 0.95, 1.0, 1.05, 1.07)
    found = [*objections(replace(stained, mass_factor=1.4, mass_offset=-0.2))]
    assert found[0] == 'disagreeing_photographs' and len(found) > 1


def test_a_small_trend_refuses_no_calibration() -> None:
    assert not objections(with_cores(0.93, 0.965, 0.99, 1.0, 1.01, 1.015, 1.02))


def test_a_sand_with_an_impossible_factor_is_refused_unless_no_tracer_was_there() -> None:
    wrong = replace(SAND, factor=2.5, at_bound=True)
    facts = objections(replace(GOOD, sands=(SAND, wrong)))['impossible_sands']
    assert facts['factors'] == {1: wrong.factor}
    guessed = replace(SAND, source='prior', deviation=0.2)
    assert not objections(replace(GOOD, sands=(SAND, guessed)))


def test_a_dilution_is_no_calibration_up_to_stock() -> None:
    assert objections(plume=replace(PLUME, strongest=0.3))['no_stock'] == {'strongest': 0.3}


@pytest.mark.parametrize(
    ('change', 'code', 'fact'),
    [
        ({'bend': -0.24}, 'strong_bend', 0.26),
        ({'dilution_misfit': 0.3}, 'misread_dilution', 0.3),
    ],
)
def test_other_disagreements_are_refused(change, code, fact) -> None:
    assert next(iter(objections(replace(GOOD, **change))[code].values())) == pytest.approx(fact)


def test_a_bent_edge_of_the_sand_is_refused() -> None:
    edges = (EdgeEvidence('lower', 0.03), EdgeEvidence('left', 0.001))
    assert objections(edges=edges)['bent_edges']['bows'] == {'lower': 0.03}


def test_a_plume_at_another_well_is_told() -> None:
    elsewhere = replace(PLUME, seen_wells=('lower',))
    assert told(GOOD, elsewhere)['other_well'].items() >= {'seen': 'lower', 'told': 'upper'}.items()
    facts = objections(replace(GOOD, mass_factor=0.3), elsewhere)['less_tracer_than_log']
    assert 'lower' in facts['elsewhere']


@pytest.mark.parametrize('anchor', ['core', 'mass', 'dilutions'])
@pytest.mark.parametrize('seen', [(), ('lower',)])
def test_a_plume_away_from_every_injecting_well_is_refused(anchor, seen) -> None:
    turned = replace(PLUME, seen_wells=seen, apart=0.3)
    found = objections(replace(GOOD, anchor=anchor), turned)
    assert (found['misplaced_plume']['apart'], found['misplaced_plume']['wells']) == (0.3, 'upper')
    # without a core the dye may as well be too pale
    assert (next(iter(found)) == 'misplaced_plume') == (anchor != 'mass' or bool(seen))


def test_a_dilution_that_disagrees_is_named() -> None:
    wrong = replace(GOOD, worst_dilution='0.85 at 40 s is read as 1.00', dilution_misfit=0.15)
    assert '0.85 at 40 s' in objections(wrong)['misread_dilution']['worst']
    small = replace(wrong, dilution_misfit=0.06)
    assert not objections(small)
    assert '0.85 at 40 s' in told(small)['misread_dilution']['worst']


def test_random_good_evidence_is_never_refused() -> None:
    generator = np.random.default_rng(3)
    for _ in range(200):
        evidence = replace(
            GOOD,
            mass_factor=generator.uniform(0.88, 1.12),
            mass_offset=generator.uniform(-0.04, 0.04),
            mass_misfit=generator.uniform(0, 0.03),
        )
        assert not objections(evidence, replace(PLUME, hollow=generator.uniform(0.85, 1.1)))
