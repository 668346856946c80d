"""Photographs of CO2 composed on real sand, and the phases that are found in them."""

import numpy as np
import pytest
from photo_examples import small_rig, textured_baseline

from lab.photographs.co2_sand import (
    INDICATORS,
    Co2Sand,
    Fluids,
    drawn_fluids,
    drawn_shot,
    phase_overlap,
)
from lab.photographs.dyed_sand import Shot
from porotwin_core.geometry.grid import conservative_resample
from porotwin_imaging.baseline.baseline import make_baseline
from porotwin_imaging.phases.phase_colours import DISSOLVED, GAS, WATER
from porotwin_imaging.phases.phase_study import PhaseStudy


@pytest.mark.parametrize('indicator', INDICATORS)
def test_the_phases_of_composed_photographs_are_found(indicator) -> None:
    rig, sand = small_rig(), textured_baseline()
    scene = Co2Sand(rig, sand, INDICATORS[indicator])
    generator = np.random.default_rng(3)
    nothing = np.zeros((2, 2))
    first = scene.photograph(Fluids(nothing, nothing), Shot(), seed=1)
    fluids = drawn_fluids(rig, generator, 0.8)
    last = scene.photograph(fluids, drawn_shot(generator), seed=2)
    baseline = make_baseline(rig, rig.default_grid(), [first])
    found = PhaseStudy.of({0.0: lambda: last}, baseline, {}).phases(last)
    shape = baseline.grid.shape
    truth = Fluids(*(conservative_resample(part, shape) for part in (fluids.indicator, fluids.gas)))
    overlaps = [phase_overlap(found.phase, truth.phases, p) for p in (WATER, DISSOLVED, GAS)]
    assert min(overlaps) > 0.85, overlaps


def test_overlap_is_the_intersection_over_the_union() -> None:
    found, truth = np.array([0, 1, 1, 2, 255]), np.array([0, 1, 2, 2, 1])
    assert phase_overlap(found, truth, DISSOLVED) == 0.5
    assert phase_overlap(found, truth, GAS) == 0.5
    assert phase_overlap(found[:1], truth[:1], GAS) == 1.0
