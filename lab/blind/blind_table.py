"""The figures of a blind check, and its report as Markdown."""

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lab.blind.blind_score import CaseScore
from porotwin_diagnosis.decision.verdict import NONE, UNEXPLAINED

CONFIDENCE_EDGES = (0.0, 0.5, 0.7, 0.85, 0.95, 1.0)
"""Bins of confidence for the calibration error: narrower where most verdicts are."""

SURE = 0.8
"""Least confidence of a name that counts as sure."""


GAP_EDGES = (0.0, 1.25, 1.5, 2.0, 3.0, 5.0, math.inf)
"""Bins of the gap in noise floors: narrow where detection begins. A gap as large as the noise makes
an error of 1.4 noise floors."""


WITH_LIBRARY_EFFECTS = ('single', 'pair', 'alike', 'three')
"""Kinds of cases whose gap the library can close."""


def summary(scores: Sequence[CaseScore]) -> dict[str, Any]:
    """Return the figures of a check by name, shares between 0 and 1; None where no case counts."""
    chosen = _by_kind(scores)
    # an effect that the library imitates is not outside of it
    strange = [
        score
        for score in chosen('outside', 'left out')
        if score.verdict == UNEXPLAINED or not score.right
    ]
    errors = [error for score in scores for error in score.parameter_errors]
    held = sum(score.intervals_held for score in scores)
    return {
        'cases': len(scores),
        'right': _share(scores, lambda score: score.right),
        'right_or_listed': _share(scores, lambda score: score.confirmed),
        'imitated': _share(scores, lambda score: score.imitated),
        'wrong_although_visible': _share(scores, _is_wrong_although_visible),
        'none_called_a_gap': _share(chosen('none'), lambda score: score.verdict != NONE),
        'sure_and_wrong_name': _share(scores, _is_sure_and_wrong),
        'outside_called_unexplained': _share(strange, lambda score: score.right),
        **_shares_of_several('both_of_a_pair', chosen('pair')),
        **_shares_of_several('both_of_a_kind', chosen('alike')),
        **_shares_of_several('all_three', chosen('three')),
        'gap_closed_median': _median(
            [s.gap_closed for s in chosen('single', 'pair', 'alike', 'three')]
        ),
        'parameter_error_median': _median(errors),
        'intervals_that_hold': held / max(len(errors), 1),
        'distance_median_m': _median([score.distance_m for score in scores]),
        'seconds_median': _median([score.seconds for score in scores]),
        'calibration_error': calibration_error(scores),
    }


def _by_kind(scores: Sequence[CaseScore]) -> Callable[..., list[CaseScore]]:
    def chosen(*kinds: str) -> list[CaseScore]:
        return [score for score in scores if score.kind in kinds]

    return chosen


def _share(scores: Sequence[CaseScore], holds: Callable[[CaseScore], bool]) -> float | None:
    return sum(map(holds, scores)) / len(scores) if scores else None


def _shares_of_several(name: str, scores: Sequence[CaseScore]) -> dict[str, float | None]:
    """Return the share of cases in which all effects were found: of all, and of those that show it.

    A recording does not show them if the true maps explain it no better than the diagnosis does.
    """
    shown = [score for score in scores if score.all_found or score.visible is not False]
    return {
        name: _share(scores, lambda score: bool(score.all_found)),
        f'{name}_where_shown': _share(shown, lambda score: bool(score.all_found)),
    }


def _median(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else None


def _is_wrong_although_visible(score: CaseScore) -> bool:
    return not score.right and score.visible is not False


def is_sure_and_wrong(verdict: str, confidence: float, *, confirmed: bool) -> bool:
    """Return whether a name is stated with confidence that is not `confirmed`."""
    return not confirmed and confidence >= SURE and verdict != UNEXPLAINED


def _is_sure_and_wrong(score: CaseScore) -> bool:
    return is_sure_and_wrong(score.verdict, score.confidence, confirmed=score.confirmed)


def calibration_error(scores: Sequence[CaseScore]) -> float:
    """Return the expected calibration error of `scores` (see `expected_error`)."""
    stated = [score.confidence for score in scores]
    return expected_error(stated, [score.confirmed for score in scores])


def expected_error(confidences: ArrayLike, right: ArrayLike) -> float:
    """Return the expected calibration error: how far confidences are from observed frequencies.

    ECE = sum_b n_b / n |mean confidence_b - share right_b|, over the bins b of `CONFIDENCE_EDGES`.
    """
    stated, observed = np.asarray(confidences, dtype=float), np.asarray(right, dtype=float)
    total = 0.0
    for low, high in pairwise(CONFIDENCE_EDGES):
        inside = (low <= stated) & ((stated < high) | (high == 1.0))
        total += abs(float(np.sum(stated[inside] - observed[inside])))
    return total / max(len(stated), 1)


def table(scores: Sequence[CaseScore], figures: Mapping[str, Any]) -> str:
    """Return the figures, all cases, strengths and the confusion matrix as Markdown."""
    lines = [
        *_figures(figures),
        '',
        *_cases(scores),
        '',
        '## Where detection begins',
        '',
        *_by_gap(scores),
        '',
        '## Confusion',
        '',
        *_confusion(scores),
    ]
    return '\n'.join(lines) + '\n'


def _figures(figures: Mapping[str, Any]) -> Iterator[str]:
    yield from ('# Blind check', '', '| figure | value |', '| --- | --- |')
    for name, value in figures.items():
        yield f'| {name.replace("_", " ")} | {value if value is None else round(value, 3)} |'


def _cases(scores: Sequence[CaseScore]) -> Iterator[str]:
    yield '| case | kind | truth | verdict | confidence | right |'
    yield '|---|---|---|---|---|---|'
    for score in scores:
        right = 'imitated' if score.imitated else 'yes' if score.right else _wrong(score)
        truth = ' + '.join(f'({name})' if name in score.absorbed else name for name in score.truth)
        yield (
            f'| {score.name} | {score.kind} | {truth} | {score.verdict} '
            f'| {score.confidence:.2f} | {right} |'
        )


def _wrong(score: CaseScore) -> str:
    """Return `no`, whether the truth is listed, and whether the recording shows it at all."""
    listed = ', but listed' if score.listed else ''
    return f'no{listed}: the true maps fit no better' if score.visible is False else f'no{listed}'


def _by_gap(scores: Sequence[CaseScore]) -> Iterator[str]:
    """Yield a table of the verdicts on cases with an effect, by the size of the gap."""
    yield (
        'Cases with an effect, by the error of the model without effects in the held-out maps, '
        'relative to the error that noise and blur alone make (noise floors).'
    )
    yield from ('', '| gap | cases | right | no gap seen | unexplained | a wrong name |')
    yield '|---|---|---|---|---|---|'
    known = [score for score in scores if score.gap is not None]
    for low, high in pairwise(GAP_EDGES):
        inside = [s for s in known if s.kind != 'none' and low <= (s.gap or 0.0) < high]
        right = sum(score.right for score in inside)
        wrong = Counter(
            score.verdict if score.verdict in (NONE, UNEXPLAINED) else 'name'
            for score in inside
            if not score.right
        )
        span = f'{low:g} to {high:g}' if math.isfinite(high) else f'above {low:g}'
        counts = (right, wrong[NONE], wrong[UNEXPLAINED], wrong['name'])
        yield f'| {span} | {len(inside)} | ' + ' | '.join(str(n or '') for n in counts) + ' |'


def _confusion(scores: Sequence[CaseScore]) -> Iterator[str]:
    counts = Counter((' + '.join(score.truth), score.verdict) for score in scores)
    truths, verdicts = (sorted({pair[k] for pair in counts}) for k in (0, 1))
    yield '| truth \\ verdict | ' + ' | '.join(verdicts) + ' |'
    yield '|---' * (len(verdicts) + 1) + '|'
    for truth in truths:
        row = (str(counts[truth, verdict] or '') for verdict in verdicts)
        yield f'| {truth} | ' + ' | '.join(row) + ' |'
