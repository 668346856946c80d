"""Tests of the belief: scores, its update against the exact solution, and its fading."""

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_siblings.belief import Belief, standard_scores

SCORES = standard_scores(3, 12, seed=4)


def test_scores_have_no_mean_and_unit_covariance() -> None:
    np.testing.assert_allclose(SCORES.mean(axis=1), 0.0, atol=1e-12)
    np.testing.assert_allclose(SCORES @ SCORES.T / 12, np.eye(3), atol=1e-12)


def test_members_have_the_mean_and_covariance_of_the_belief() -> None:
    covariance = np.array([[2.0, 0.5, 0.0], [0.5, 1.0, 0.3], [0.0, 0.3, 0.5]])
    members = Belief(np.array([1.0, 2.0, 3.0]), covariance).members(SCORES)
    np.testing.assert_allclose(members.mean(axis=1), [1.0, 2.0, 3.0])
    np.testing.assert_allclose(np.cov(members, bias=True), covariance, atol=1e-12)


@pytest.mark.parametrize('inflation', [1.0, 2.0])
def test_a_linear_observation_gives_the_kalman_update(inflation: float) -> None:
    belief = Belief.independent(np.array([1.0, -1.0, 0.5]), np.array([1.0, 0.5, 2.0]))
    looks = np.array([[1.0, 2.0, 0.0], [0.5, -1.0, 1.0]])
    variance, observed = np.array([0.1, 0.2]), np.array([3.0, 0.0])
    scores = inflation * SCORES
    found = belief.updated(scores, looks @ belief.members(scores), observed, variance)
    gain = belief.covariance @ looks.T
    gain = gain @ np.linalg.inv(looks @ gain + np.diag(variance))
    np.testing.assert_allclose(found.mean, belief.mean + gain @ (observed - looks @ belief.mean))
    np.testing.assert_allclose(
        found.covariance, belief.covariance - gain @ looks @ belief.covariance
    )


KNOWN = Belief(
    np.array([1.0, 2.0, 3.0]), np.array([[2.0, 0.5, 0.0], [0.5, 1.0, 0.3], [0.0, 0.3, 0.5]])
)


def test_what_another_observer_saw_of_one_unknown_tells_about_the_others_as_a_look_at_it() -> None:
    look, variance, seen = np.array([[0.0, 1.0, 0.0]]), np.array([0.5]), np.array([1.2])
    observed = KNOWN.updated(SCORES, look @ KNOWN.members(SCORES), seen, variance)
    place = np.array([1])
    found = KNOWN.with_marginal(place, observed.mean[place], observed.deviation[place], linear=4.0)
    np.testing.assert_allclose(found.mean, observed.mean)
    np.testing.assert_allclose(found.covariance, observed.covariance)


def test_an_unknown_that_jumps_tells_nothing_about_the_others() -> None:
    found = KNOWN.with_marginal(np.array([1]), np.array([-60.0]), np.array([0.1]), linear=4.0)
    np.testing.assert_allclose(found.mean, [1.0, -60.0, 3.0])
    np.testing.assert_allclose(found.covariance, np.diag([2.0, 0.01, 0.5]), atol=1e-12)


def test_what_was_learnt_fades_to_the_prior() -> None:
    prior = Belief.independent(np.zeros(3), np.ones(3))
    known = Belief.independent(np.ones(3), np.full(3, 0.1))
    half = known.relaxed(prior, 0.5)
    np.testing.assert_allclose(half.mean, 0.5)
    assert (half.deviation > known.deviation).all()
    np.testing.assert_allclose(known.relaxed(prior, 1.0).covariance, prior.covariance)


def test_too_few_siblings_are_refused() -> None:
    with pytest.raises(InputError, match='siblings 3: 3 unknowns need at least 4'):
        standard_scores(3, 3, seed=1)
