"""The figures of a blind check and its report."""

from dataclasses import replace

import pytest

from lab.blind.blind_score import CaseScore
from lab.blind.blind_table import calibration_error, summary, table

SCORE = CaseScore('c', 'single', ('rate',), 'rate', 0.9, right=True, seconds=60.0)


def scores(confidence, hits, count):
    return [replace(SCORE, confidence=confidence, right=n < hits) for n in range(count)]


def test_the_figures_count_wrong_and_confident_names():
    right = replace(SCORE, kind='none', truth=('none',), verdict='none')
    wrong = replace(right, verdict='rate', right=False)
    figures = summary([right, wrong])
    assert figures['right'] == 0.5
    assert figures['none_called_a_gap'] == 0.5
    assert figures['sure_and_wrong_name'] == 0.5
    assert '| none | 1 | 1 |' in table([right, wrong], figures)


def test_an_effect_that_the_library_imitates_is_not_outside_of_it():
    left_out = replace(SCORE, kind='left out', truth=('depth',))
    unexplained = replace(left_out, verdict='unexplained')
    imitated = replace(left_out, imitated=True)
    wrong = replace(left_out, right=False)
    figures = summary([unexplained, imitated, wrong])
    assert figures['outside_called_unexplained'] == 0.5
    assert figures['imitated'] == pytest.approx(1 / 3)


def test_calibration_error_is_zero_only_if_the_frequencies_agree():
    assert calibration_error(scores(0.9, 9, 10)) == pytest.approx(0.0)
    assert calibration_error(scores(0.9, 5, 10)) == pytest.approx(0.4)


def test_a_failed_case_counts_as_wrong_and_has_no_time():
    failed = CaseScore('c', 'single', ('rate',), 'failed', 0.0, right=False)
    figures = summary([failed])
    assert figures['right'] == 0.0
    assert figures['seconds_median'] is None
    assert 'failed' in table([failed], figures)


def test_the_report_says_from_which_gap_on_effects_are_found():
    weak = replace(SCORE, gap=1.1, verdict='none', right=False)
    strong = replace(SCORE, gap=7.0)
    none = replace(SCORE, kind='none', truth=('none',), verdict='none', gap=1.0)
    cases = [weak, strong, none]
    report = table(cases, summary(cases))
    assert '| 0 to 1.25 | 1 |  | 1 |  |  |' in report
    assert '| above 5 | 1 | 1 |  |  |  |' in report


def test_a_truth_that_the_recording_does_not_show_is_told():
    hidden = replace(SCORE, right=False, visible=False)
    missed = replace(SCORE, right=False, visible=True)
    cases = [SCORE, hidden, missed, replace(missed, visible=None)]
    figures = summary(cases)
    assert figures['right'] == 0.25
    assert figures['wrong_although_visible'] == 0.5
    assert 'no: the true maps fit no better' in table(cases, figures)


def test_a_truth_that_is_listed_as_inseparable_counts_beside_right_ones():
    listed = replace(SCORE, verdict='porosity', right=False, listed=True)
    cases = [SCORE, listed]
    figures = summary(cases)
    assert (figures['right'], figures['right_or_listed']) == (0.5, 1.0)
    assert figures['sure_and_wrong_name'] == 0.0
    assert figures['calibration_error'] == calibration_error([SCORE, SCORE])
    assert '| no, but listed |' in table(cases, figures)


def test_effects_that_a_recording_does_not_show_need_not_be_found_together():
    both = replace(SCORE, kind='alike', all_found=True)
    hidden = replace(both, all_found=False, visible=False)
    missed = replace(both, all_found=False, visible=True)
    figures = summary([both, hidden, missed])
    assert figures['both_of_a_kind'] == pytest.approx(1 / 3)
    assert figures['both_of_a_kind_where_shown'] == 0.5
    assert figures['all_three_where_shown'] is None
