"""The response of a prediction to rough sand."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import candidate, sample_of

from porotwin_diagnosis.model.fitter import Fitter
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.model.rough_sand import ROUGHNESS, RoughSands, on_rough_sand
from porotwin_diagnosis.search.ranking import normalised_misfit


@pytest.fixture(scope='module')
def sample(denser_sand):
    return sample_of(denser_sand)


def test_a_less_viscous_tracer_amplifies_the_roughness_of_the_sand(sample):
    sands = RoughSands([[Forward(on_rough_sand(sample, seed))] for seed in (0, 1)])
    fitter = Fitter([Forward(sample, point_spread_width=0.3)], rough_sands=sands)
    viscosity = candidate([sample], 'viscosity')

    def amplification(ratio):
        scaled = np.array([viscosity.parameters[0].scaled(ratio)])
        return fitter.evaluate((viscosity,), scaled).fingering_amplification

    assert amplification(1.5) == (1.0, 1.0)
    thin, thinner = amplification(0.8), amplification(0.5)
    assert 1.0 <= thin[1] < thinner[1]


def test_a_described_viscosity_is_allowed_the_same_as_a_fitted_one(sample):
    viscosity = candidate([sample], 'viscosity')
    scaled = np.array([viscosity.parameters[0].scaled(0.5)])
    thin = sample.rig.model_copy(update={'effects': (viscosity.described(scaled),)})
    known = replace(sample, rig=thin)

    def fitter(data):
        sands = RoughSands([[Forward(on_rough_sand(data, seed))] for seed in (0, 1)])
        return Fitter([Forward(data, point_spread_width=0.3)], rough_sands=sands)

    fitted = fitter(sample).evaluate((viscosity,), scaled)
    described = fitter(known).evaluate((), np.zeros(0))
    assert described.fingering_amplification == pytest.approx(fitted.fingering_amplification)
    assert normalised_misfit(described) == pytest.approx(normalised_misfit(fitted))


def test_without_sands_nothing_is_amplified(sample):
    viscosity = candidate([sample], 'viscosity')
    thin = (viscosity.described([viscosity.parameters[0].scaled(0.5)]),)
    forward = Forward(sample)
    found = RoughSands().fingering_amplification([forward], thin)
    assert found == (1.0, 1.0)
    assert forward.simulations == 0


def test_rough_sand_depends_on_the_seed_only_and_keeps_its_mean_permeability(sample):
    one, same, other = (
        on_rough_sand(sample, seed).rig.nominal_map('permeability_m2') for seed in (0, 0, 1)
    )
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)
    ratio = np.log(one / sample.rig.field('permeability_m2', sample.grid.refined(2)))
    assert ratio.std() == pytest.approx(ROUGHNESS, rel=0.05)
    assert abs(ratio.mean()) < 0.003
