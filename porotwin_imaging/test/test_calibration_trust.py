"""Whether a calibration is trusted: each disagreement is named, and good ones pass."""

import math
from dataclasses import replace

import numpy as np
import pytest

from porotwin_imaging.baseline.covered_baseline import Cover
from porotwin_imaging.baseline.sand_edges import EdgeEvidence
from porotwin_imaging.calibrating.calibration_evidence import (
    CalibrationEvidence,
    PhotographEvidence,
    SandEvidence,
    evidence_lines,
)
from porotwin_imaging.calibrating.calibration_trust import Trust, judged
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
    family='absorbance',
    bend=0.03,
    bend_deviation=0.01,
    colour_bend={},
    core_flatness=0.01,
    mass_factor=1.0,
    mass_factor_deviation=0.01,
    mass_offset=0.0,
    mass_misfit=0.005,
    dilution_misfit=NAN,
)
PLUME = PlumeEvidence(1.05e-3, 1.05e-3, 1.0, ('upper',), ('upper',), 1.0)


def refusal(evidence: CalibrationEvidence = GOOD, plume: PlumeEvidence = PLUME, edges=()) -> str:
    trust = judged(evidence, plume, edges)
    assert '\n' not in trust.refusal
    return trust.refusal


def test_a_calibration_whose_evidence_agrees_is_trusted_without_a_remark() -> None:
    assert judged(GOOD, PLUME) == Trust()
    assert judged(GOOD, PLUME).refusal == ''


def test_a_covered_baseline_is_the_first_reason_but_none_of_its_own() -> None:
    cover = Cover(0.13, 4, ('base.jpg',))
    assert judged(GOOD, PLUME, cover=cover) == Trust()
    line = judged(replace(GOOD, mass_factor=0.3), PLUME, cover=cover).refusal
    assert line.startswith('calibration refused: the baseline base.jpg does not show the sand on')
    assert 'take another baseline (also: the pump log injected' in line


def test_fronts_that_contradict_the_masses_are_refused_unless_a_dilution_decides() -> None:
    fronts = FrontFit(-0.15, 0.02, 1.3, 0.0, 0.01)
    line = refusal(replace(GOOD, fronts=fronts))
    assert 'half of stock would look like 0.35 and 0.53' in line
    assert 'photograph one dilution (half stock)' in line
    assert refusal(replace(GOOD, fronts=fronts, dilution_misfit=0.01)) == ''
    agreeing = replace(fronts, bend=0.04)
    assert refusal(replace(GOOD, fronts=agreeing)) == ''
    assert 'one dilution' in refusal(replace(GOOD, fronts=replace(agreeing, at_end=True)))


def test_fronts_that_fit_many_bends_refuse_no_good_injection() -> None:
    unsure = FrontFit(-0.145, 0.042, 1.0, 0.0, 0.033, at_end=True)
    assert refusal(replace(GOOD, bend=-0.12, fronts=unsure)) == ''
    assert 'half of stock' in refusal(replace(GOOD, bend=-0.05, fronts=unsure))


@pytest.mark.parametrize(('deviation', 'is_refused'), [(0.05, False), (0.01, True)])
def test_a_strong_bend_is_refused_only_if_it_is_sure(deviation: float, is_refused: bool) -> None:
    line = refusal(replace(GOOD, bend=0.19, bend_deviation=deviation))
    assert ('half of stock would look like 0.69' in line) == is_refused


def test_a_conflict_of_fronts_shows_its_limit_where_figures_round_to_the_same_text() -> None:
    beyond = replace(GOOD, bend=-0.142, fronts=FrontFit(-0.145, 0.02, 1.3, 0.0, 0.01, at_end=True))
    line = refusal(beyond)
    assert 'no response that a dye can have fits the fronts' in line
    assert '0.36 and 0.36' not in line
    apart = refusal(replace(GOOD, bend=0.0301, fronts=FrontFit(-0.0509, 0.02, 1.3, 0.0, 0.01)))
    assert '0.45 and 0.53 of stock, 0.081 apart (limit 0.08)' in apart


@pytest.mark.parametrize(('difference', 'named'), [(0.05, True), (0.3, False), (NAN, False)])
def test_the_other_contrast_is_a_remedy_only_if_it_keeps_the_colours(difference, named) -> None:
    fronts = FrontFit(-0.15, 0.02, 1.3, 0.0, 0.01)
    colours = {'absorbance': 0.12, 'difference': difference}
    line = refusal(replace(GOOD, fronts=fronts, colour_bend=colours, family='exponential'))
    assert ('--contrast difference' in line) == named


@pytest.mark.parametrize(
    ('factor', 'words'),
    [(1 / 3, '3.00 times more tracer than the plume'), (3.0, '3.00 times less tracer')],
)
def test_a_pump_log_that_is_wrong_by_three_is_refused_with_reasons_and_a_remedy(
    factor, words
) -> None:
    line = refusal(replace(GOOD, mass_factor=factor))
    assert words in line
    assert 'rates.csv' in line
    assert 'weigh the stock' in line


@pytest.mark.parametrize('factor', [0.77, 1.3])
def test_a_log_wrong_by_a_third_is_refused_by_the_core(factor) -> None:
    assert 'times' in refusal(replace(GOOD, mass_factor=factor))


@pytest.mark.parametrize('factor', [0.89, 0.93, 1.1])
def test_sorption_or_a_porosity_off_by_ten_percent_is_told_and_not_refused(factor) -> None:
    trust = judged(replace(GOOD, mass_factor=factor), PLUME)
    assert not trust.objections
    assert 'tracer than the pump log' in trust.remarks[0]


def test_a_small_uncertain_difference_is_not_told() -> None:
    uncertain = replace(GOOD, mass_factor=1.05, mass_factor_deviation=0.05)
    assert judged(uncertain, PLUME) == Trust()


def test_without_a_core_the_filled_pores_judge_the_pump_log() -> None:
    by_mass = replace(GOOD, anchor='mass', mass_factor=1.0)
    assert 'more tracer' in refusal(by_mass, replace(PLUME, pore_volume=3.5e-4))
    assert 'less tracer' in refusal(by_mass, replace(PLUME, pore_volume=3.1e-3))
    assert 'nan' not in refusal(
        replace(GOOD, mass_factor=9.0), replace(PLUME, pore_volume=math.nan)
    )
    trust = judged(by_mass, PLUME)
    assert not trust.objections
    assert 'no photograph shows a core' in trust.remarks[0]


def test_a_dye_that_is_not_seen_is_named_first() -> None:
    line = refusal(
        replace(disagreeing(7), anchor='mass'),
        replace(PLUME, seen_wells=(), pore_volume=3e-4),
    )
    assert line.startswith('calibration refused: no plume is seen at well upper')


def test_without_a_pump_log_there_is_nothing_to_compare() -> None:
    alone = replace(GOOD, anchor='strongest signal', mass_factor=NAN, mass_offset=NAN)
    plume = replace(PLUME, fluid=NAN, strongest=NAN, told_wells=())
    trust = judged(replace(alone, mass_misfit=NAN), plume)
    assert not trust.objections
    assert 'the amount of tracer in the maps was not checked' in trust.remarks[0]


def test_one_photograph_does_not_agree_with_itself() -> None:
    one = replace(GOOD, photographs=PHOTOGRAPHS[:1], mass_misfit=0.0)
    trust = judged(one, PLUME)
    assert not trust.objections
    assert any('one photograph cannot show' in line for line in trust.remarks)
    mass = next(line for line in evidence_lines(one) if line.startswith('mass:'))
    assert 'agree' not in mass


def test_the_evidence_of_every_sand_is_told_in_words() -> None:
    sands = (SAND, replace(SAND, source='prior', deviation=0.2))
    line = evidence_lines(replace(GOOD, sands=sands))[0]
    assert '(seen: the core of a plume)' in line
    assert '(guessed from its brightness: no plume there)' in line


def test_a_baseline_with_tracer_is_named() -> None:
    line = refusal(replace(GOOD, mass_offset=-0.2), replace(PLUME, hollow=0.1))
    assert 'pale at its own well' in line
    assert 'baseline before any tracer' in line
    line = refusal(replace(GOOD, mass_factor=0.5), replace(PLUME, hollow=0.0))
    assert line.index('pale at its own well') < line.index('the pump log injected')


@pytest.mark.parametrize(('offset', 'words'), [(0.2, 'seen before'), (-0.2, 'missing from')])
def test_tracer_before_the_injection_is_explained(offset, words) -> None:
    assert words in refusal(replace(GOOD, mass_offset=offset))
    told = judged(replace(GOOD, mass_offset=offset / 2), PLUME)
    assert not told.objections
    assert words in told.remarks[0]


def disagreeing(count: int) -> CalibrationEvidence:
    some = [replace(one, disagreement='a shadow') for one in PHOTOGRAPHS[:count]]
    return replace(GOOD, photographs=(*some, *PHOTOGRAPHS[count:]))


def test_most_photographs_must_agree_and_the_others_are_named() -> None:
    assert refusal(disagreeing(2)) == ''
    assert '3 of 7 photographs agree (300 s: a shadow; ' in refusal(disagreeing(4))


def with_cores(*levels: float) -> CalibrationEvidence:
    some = [
        replace(one, core_level=level, disagreement='' if abs(level - 1) < 0.04 else 'its core')
        for one, level in zip(PHOTOGRAPHS, levels, strict=True)
    ]
    return replace(GOOD, photographs=tuple(some), rates_file='rates_measured.csv')


def test_cores_that_get_steadily_darker_are_a_stain_or_diluted_stock() -> None:
    line = refusal(with_cores(0.47, 0.71, 0.86, 0.95, 1.0, 1.05, 1.07))
    assert 'gets steadily darker (0.47 of stock at 300 s, 1.07 at 2100 s)' in line
    assert 'dye that stays on the sand' in line
    assert 'stronger later than in rates_measured.csv' in line
    assert 'flush with clean water' in line
    assert 'hands' not in line
    assert 'photographs agree' not in line


def test_cores_that_get_steadily_paler_are_fading_light_or_water() -> None:
    line = refusal(with_cores(1.3, 1.2, 1.1, 1.0, 0.9, 0.8, 0.7))
    assert 'gets steadily paler (1.30 of stock at 300 s, 0.70 at 2100 s)' in line
    assert 'tracer that fades, light that drifts, or water that enters' in line
    assert 'inject fresh stock' in line


def test_changing_cores_come_before_the_masses_that_follow_from_them() -> None:
    stained = with_cores(0.47, 0.71, 0.86, 0.95, 1.0, 1.05, 1.07)
    line = refusal(replace(stained, mass_factor=1.4, mass_offset=-0.2))
    assert line.startswith('calibration refused: the core of the plume gets steadily darker')
    assert '(also: ' in line


def test_cores_that_change_to_and_fro_are_hands_and_shadows() -> None:
    line = refusal(with_cores(0.8, 1.3, 0.7, 1.0, 1.2, 0.9, 1.0))
    assert '2 of 7 photographs agree' in line
    assert 'hands, shadows or reflections' in line


def test_a_small_trend_refuses_no_calibration() -> None:
    assert refusal(with_cores(0.93, 0.965, 0.99, 1.0, 1.01, 1.015, 1.02)) == ''


def test_a_sand_with_an_impossible_factor_is_refused_unless_no_tracer_was_there() -> None:
    wild = replace(SAND, factor=37.7)
    assert 'sand 1 x 37.70' in refusal(replace(GOOD, sands=(SAND, wild)))
    at_bound = replace(SAND, factor=1.6, at_bound=True)
    assert 'sand 1 x 1.60' in refusal(replace(GOOD, sands=(SAND, at_bound)))
    guessed = replace(SAND, source='prior', deviation=0.2)
    assert refusal(replace(GOOD, sands=(SAND, guessed))) == ''


def test_a_dilution_is_no_calibration_up_to_stock() -> None:
    assert 'fluid is 0.3 of stock' in refusal(plume=replace(PLUME, strongest=0.3))


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        ({'bend': -0.24}, 'half of stock would look like 0.26'),
        ({'mass_misfit': 0.15}, 'scatters by 15 %'),
        ({'core_flatness': 0.3}, 'core of the plume is not even'),
        ({'dilution_misfit': 0.3}, 'a dilution is read 0.30'),
    ],
)
def test_other_disagreements_are_refused(change, words) -> None:
    assert words in refusal(replace(GOOD, **change))


def test_a_bent_edge_of_the_sand_is_refused() -> None:
    edges = (EdgeEvidence('lower', 0.03), EdgeEvidence('left', 0.001))
    line = refusal(edges=edges)
    assert 'lower edge 3.0 %' in line
    assert 'left' not in line
    assert 'camera.curvature' in line


def test_a_plume_at_another_well_is_told() -> None:
    elsewhere = replace(PLUME, seen_wells=('lower',))
    (remark,) = judged(GOOD, elsewhere).remarks
    assert 'the plume is at well lower, the pump log says upper' in remark
    assert 'the plume is at well lower' in refusal(replace(GOOD, mass_factor=0.3), elsewhere)


@pytest.mark.parametrize('anchor', ['core', 'mass', 'dilutions'])
@pytest.mark.parametrize('seen', [(), ('lower',)])
def test_a_plume_away_from_every_injecting_well_is_refused(anchor, seen) -> None:
    turned = replace(PLUME, seen_wells=seen, apart=0.3)
    line = refusal(replace(GOOD, anchor=anchor), turned)
    assert '30 % of the width of the rig away from well upper' in line
    if anchor != 'mass':  # without a core the dye may as well be too pale
        assert 'turned or mirrored' in line


def test_a_dilution_that_disagrees_is_named() -> None:
    wrong = replace(GOOD, worst_dilution='0.85 at 40 s is read as 1.00', dilution_misfit=0.15)
    assert '(0.85 at 40 s is read as 1.00)' in refusal(wrong)
    trust = judged(replace(wrong, dilution_misfit=0.06), PLUME)
    assert not trust.objections
    assert '0.85 at 40 s' in trust.remarks[0]


def test_the_most_telling_objection_comes_first_and_the_others_are_named() -> None:
    line = refusal(replace(GOOD, mass_factor=3.0, mass_misfit=0.2))
    assert line.index('times less') < line.index('also: the tracer in the photographs scatters')


def test_random_good_evidence_is_never_refused() -> None:
    generator = np.random.default_rng(3)
    for _ in range(200):
        evidence = replace(
            GOOD,
            mass_factor=generator.uniform(0.88, 1.12),
            mass_offset=generator.uniform(-0.04, 0.04),
            mass_misfit=generator.uniform(0, 0.03),
            core_flatness=generator.uniform(0, 0.06),
        )
        assert refusal(evidence, replace(PLUME, hollow=generator.uniform(0.85, 1.1))) == ''


def test_a_refusal_names_the_file_with_the_measured_rates() -> None:
    measured = replace(GOOD, mass_factor=0.3, rates_file='rates_measured.csv')
    refusal = judged(measured, PLUME).refusal
    assert 'correct rates_measured.csv' in refusal
    assert ' rates.csv' not in refusal
