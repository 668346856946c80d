"""The search for effects that explain a gap: every effect alone, then in pairs, on finer and finer
cells.

1. Screening: every effect is fitted on coarse cells (`single_effects`).
2. Refinement: the best fits are fitted again on the cells of the recording.
3. Judgement: the best of those are fitted on fine cells, then again with the multifidelity
   correction and the point spread that suit them (`levels`).
4. Onsets: if no single effect closes the gap, effects that begin during the recording are fitted
   (`onset_scan`). One is kept beside the others if it earns its place.
5. Pairs: if none of them closes the gap, pairs go through the same stages, and if no pair
   closes it, triples (`effects_together`).

If the model without effects leaves no gap, the search ends early: effects without a place
are screened, and the best one is judged.
"""

from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import CancelledError
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from porotwin_core.basis.parallel import Crew
from porotwin_diagnosis.data.sample import Sample
from porotwin_diagnosis.model.fit import Fit, with_noise_share
from porotwin_diagnosis.model.polishing import polished
from porotwin_diagnosis.progress import Progress, no_progress
from porotwin_diagnosis.search.close_rivals import compared_rivals
from porotwin_diagnosis.search.effects_together import (
    hopeful,
    judged_inside,
    judged_together,
    worth_keeping,
)
from porotwin_diagnosis.search.endable_crew import EndableCrew
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.levels import Judgement, Levels, make_levels
from porotwin_diagnosis.search.noise_bound import (
    with_bounded_findings,
    with_bounded_levels,
)
from porotwin_diagnosis.search.onset_scan import fits_with_onsets
from porotwin_diagnosis.search.prior import NO_PRIOR, Prior
from porotwin_diagnosis.search.ranking import (
    close_to_best,
    earns_its_place,
    first_of_each_effect,
    leaves_a_gap,
    may_need_a_second_effect,
    normalised_misfit,
    score,
)
from porotwin_diagnosis.search.single_effects import (
    SearchSpace,
    coarsely_fitted_singles,
    screened_singles,
    search_space,
)
from porotwin_diagnosis.thresholds import (
    BEAM,
    CORRECTED_MISFIT,
    NO_GAP_MISFIT,
    WIDE_BEAM,
)


class SearchStep(NamedTuple):
    """The levels that are in use, and the findings so far."""

    levels: Levels
    findings: Findings

    @property
    def is_coarse(self) -> bool:
        """Whether no fit was judged on finer cells yet."""
        return self.findings.null is self.findings.screened_null

    @property
    def best(self) -> Fit:
        """The judged effects that leave the least."""
        findings = self.findings
        firsts = (*findings.triples[:1], *findings.pairs[:1], *findings.singles[:1])
        return min(firsts, key=score)

    def completed(self) -> 'SearchStep':
        """Return the step with the changes and distances that a verdict needs.

        Fits on coarse cells are judged there, with the errors of the scheme taken back at the best
        one, as on finer cells.
        """
        levels, findings = self
        if self.is_coarse:
            levels, findings = _judged_on_coarse_cells(levels, findings)
        findings = replace(
            findings,
            part_changes=[levels.relative_change(part.effects) for part in findings.parts],
            distances=levels.distances(findings.singles),
            pair_distances=levels.distances(findings.pairs),
        )
        return SearchStep(levels, replace(findings, runs=levels.simulations))


SoFar = Callable[[SearchStep], None]
"""Called with the findings so far, and the levels on which they can be judged."""


def search_effects(
    samples: Sequence[Sample],
    *,
    excluded: Collection[str] = (),
    prior: Prior = NO_PRIOR,
    progress: Progress = no_progress,
    so_far: SoFar = lambda _step: None,
    ended: Callable[[], bool] = lambda: False,
    crew: Crew | None = None,
) -> SearchStep:
    """Search for effects that explain recordings of one rig.

    Args:
        samples: the recordings; an effect has the same parameters in all of them.
        excluded: names of effects to leave out.
        prior: the belief before these recordings; it decides between close rivals.
        progress: called with the stage and the fraction done: about 0.25 when single effects are
            judged, 0.55 with pairs, and 0.9 with triples.
        so_far: called whenever an effect was fitted on coarse cells, and after each later stage.
        ended: asked before every simulation; true ends the search with the findings so far.
        crew: runs the simulations; None: one at a time.

    Returns:
        The complete findings, and the levels with the corrections that were last in use: those of
        coarse cells, if the search was ended before any effect was judged on finer ones.

    Raises:
        InputError: no effect without a place remains, or the model cannot run without effects.
        CancelledError: the search was ended before the first effect was fitted.
    """
    space = search_space(samples, excluded)
    endable = EndableCrew(crew, ended)
    levels = make_levels(samples, progress=progress, crew=endable)
    found: SearchStep | None = None
    with endable.search():
        for found in _steps(levels, space, prior):
            so_far(found)
    if found is None:
        raise CancelledError
    return found.completed()


def _steps(levels: Levels, space: SearchSpace, prior: Prior) -> Iterator[SearchStep]:
    """Yield the findings after each step; the last ones are whole.

    All others name what is untried.
    """
    levels.progress('running the model without effects', 0.0)
    null = levels.null()
    if score(null) < CORRECTED_MISFIT:
        levels = levels.with_corrected_coarse_cells(())
    corrected = levels.corrected_at(null)
    screened_null = levels.screening.evaluate((), np.zeros(0))
    coarse: list[Fit] = []
    for coarse, left in coarsely_fitted_singles(levels, space):
        yield _on_coarse_cells(levels, screened_null, coarse, left, prior)
    if max(normalised_misfit(fit) for fit in (null, corrected.null())) < NO_GAP_MISFIT:
        first, *_ = coarse
        singles = [polished(corrected.judging, first, corrected.refining)]
        found = _with_bounded_noise(
            corrected, Findings(corrected.null(), screened_null, coarse, singles, prior=prior)
        )
        if normalised_misfit(found.findings.null) < NO_GAP_MISFIT:
            yield found
            return
    screened: list[Fit] = []
    for screened, left in screened_singles(levels, space, coarse):
        yield _on_coarse_cells(levels, screened_null, screened, left, prior)
    levels, singles = _judged_singles(levels, screened, null)
    levels = levels.corrected_at(null)
    findings = Findings(levels.null(), screened_null, screened, singles, prior=prior)
    levels, findings = _with_bounded_noise(levels, findings)
    if may_need_a_second_effect(findings.singles[0], findings.null):
        yield SearchStep(levels, replace(findings, untried='effects that begin during it'))
        levels, findings = _with_onsets(levels, space, findings)
    if may_need_a_second_effect(findings.singles[0], findings.null):
        for untried, step in (('pairs of effects', _with_pairs), ('a third effect', _with_triples)):
            yield SearchStep(levels, replace(findings, untried=untried))
            levels, findings = step(levels, space, findings)
        levels, findings = _with_bounded_noise(levels, findings)
    yield SearchStep(levels, replace(findings, untried='close rivals on equal terms'))
    levels, singles = compared_rivals(levels, findings.singles, findings.null, prior)
    yield SearchStep(levels, replace(findings, singles=singles))


def _on_coarse_cells(
    levels: Levels, null: Fit, fits: Sequence[Fit], left: Sequence[str], prior: Prior
) -> SearchStep:
    """Return the findings so far, from `fits` on coarse cells; `left` effects have none yet."""
    best = close_to_best(first_of_each_effect(fits))[:WIDE_BEAM]
    untried = ', '.join([*left, 'finer cells', 'combinations of effects'])
    findings = Findings(null, null, fits, levels.ranked(best), prior=prior, untried=untried)
    return SearchStep(levels, findings)


def _judged_on_coarse_cells(levels: Levels, findings: Findings) -> SearchStep:
    """Return coarse levels that are corrected at the best fit, and the fits judged on them."""
    best = findings.singles[0]
    if score(best) < CORRECTED_MISFIT:
        levels = levels.with_corrected_coarse_cells(best.effects)
    levels = replace(levels, refining=levels.screening, judging=levels.screening)
    singles = levels.ranked(list(map(levels.judging.evaluated_again, findings.singles)))
    return _with_bounded_noise(levels, replace(findings, singles=singles))


def _judged_singles(levels: Levels, screened: Sequence[Fit], null: Fit) -> Judgement:
    best = close_to_best(first_of_each_effect(screened))[:WIDE_BEAM]
    judged = levels.judged(levels.refined(best, 0.15), 0.18)
    levels = with_bounded_levels(levels, [null, *judged])
    share = levels.judging.noise_share
    fits = [with_noise_share(fit, share) for fit in judged]
    return levels.judged_again(fits, with_noise_share(null, share), 0.22)


def _with_bounded_noise(levels: Levels, findings: Findings) -> SearchStep:
    """Return levels and `findings` with no more noise than their best fit leaves."""
    fits = (findings.null, *findings.singles, *findings.pairs, *findings.triples)
    levels = with_bounded_levels(levels, fits)
    return SearchStep(levels, with_bounded_findings(levels, findings))


def _with_onsets(levels: Levels, space: SearchSpace, findings: Findings) -> SearchStep:
    """Return `findings` with the effects that begin during the recording and earn their place."""
    fits = fits_with_onsets(levels, space.beginning)
    promising = [fit for fit in fits if earns_its_place(fit, findings.screened[0])]
    refined = levels.refined(close_to_best(promising)[:BEAM], 0.24)
    judged = levels.judged_again(levels.judged(refined, 0.24), findings.null, 0.24)
    found = [fit for fit in judged.fits if earns_its_place(fit, findings.singles[0])]
    if not found:
        return SearchStep(levels, findings)
    singles = levels.ranked([*found, *findings.singles])
    return _with_bounded_noise(judged.levels, replace(findings, singles=singles))


def _with_pairs(levels: Levels, space: SearchSpace, findings: Findings) -> SearchStep:
    """Return `findings` with pairs."""
    bases = (findings.screened_null, findings.singles[0])
    levels, pairs = judged_together(levels, space, bases, findings.null, 2)
    return _with_members(levels, replace(findings, pairs=pairs), pairs, 0.52)


def _with_triples(levels: Levels, space: SearchSpace, findings: Findings) -> SearchStep:
    """Return `findings` with triples and the pairs inside them.

    A single effect that suffices when it is fitted again needs no third effect.
    """
    pairs, null = findings.pairs, findings.null
    if not leaves_a_gap(findings.singles[0]) or not hopeful(pairs, null):
        return SearchStep(levels, findings)
    levels, triples = judged_together(levels, space, pairs[:1], null, 3)
    if not worth_keeping(triples, pairs[0]):
        return SearchStep(levels, findings)
    levels, inside = judged_inside(levels, triples, null)
    pairs = levels.ranked([*pairs, *inside])
    triples = worth_keeping(triples, pairs[0])
    findings = replace(findings, pairs=pairs, triples=triples)
    return _with_members(levels, findings, triples or pairs, 0.88)


def _with_members(
    levels: Levels, findings: Findings, judged: Sequence[Fit], begin: float
) -> SearchStep:
    """Return `findings` with the members of the first of the `judged` combinations, if any.

    Members that were stuck alone are fitted again. The levels are corrected at the combination.
    `begin` is the progress at the beginning.
    """
    if not judged:
        return SearchStep(levels, findings)
    levels = levels.corrected_at(judged[0])
    findings = replace(findings, parts=_members_alone(levels, judged[0]))
    levels, singles = fitted_again_alone(levels, findings, begin)
    return SearchStep(levels, replace(findings, singles=singles))


def _members_alone(levels: Levels, combination: Fit) -> list[Fit]:
    """Return the members of a `combination`, each judged alone with its parameters there."""
    return [
        levels.judging.evaluate((member,), scaled)
        for member, scaled, _ in combination.member_parameters
    ]


def fitted_again_alone(levels: Levels, findings: Findings, begin: float) -> Judgement:
    """Return the judged single effects, with stuck members of the best combination fitted again.

    A member is fitted again if, with its parameters there, it scores better than every single fit:
    its own fit was stuck before it reached them. `begin` is the progress at the beginning.

    Raises:
        InputError: the model cannot run with one of the fits.
    """
    singles = list(findings.singles)
    better = [part for part in findings.parts if score(part) < score(singles[0])]
    if not better:
        return Judgement(levels, singles)
    judged = levels.judged(levels.refined(better, begin), begin)
    levels, again = levels.judged_again(judged, findings.null, begin + 0.02)
    return Judgement(levels, levels.ranked([*again, *singles]))
