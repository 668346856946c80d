"""Learnt physics is told with the units of the laboratory."""

import math

from porotwin_core.basis.units import from_ml_h
from porotwin_core.model.learnt_physics import LearntLeak, LearntPhysics, SandPatch
from porotwin_costa.physics.learnt_words import coefficient_lines


def test_a_model_without_learnt_physics_tells_none() -> None:
    assert coefficient_lines(LearntPhysics(scheme='accurate')) == []


def test_every_coefficient_has_its_unit() -> None:
    learnt = LearntPhysics(
        density_difference=0.82,
        longitudinal_dispersivity=0.002,
        transverse_dispersivity=0.0002,
        background_flux=(5e-7, -4e-7),
        log_retardation=math.log(1.069),
    )
    assert coefficient_lines(learnt) == [
        'learnt density of the tracer: +0.82 kg/m3',
        'learnt dispersivity: +2 mm along the flow, +0.2 mm across it',
        'learnt background flow: 0.5 um/s to the right, -0.4 um/s upward',
        'learnt retardation: factor 1.069',
    ]


def test_leaks_and_patches_are_told_with_their_places() -> None:
    learnt = LearntPhysics(
        leaks=(LearntLeak(0.185, 0.35, from_ml_h(-19.0)), LearntLeak(0.1, 0.2, from_ml_h(5.0))),
        patches=(SandPatch(0.35, 0.171, 0.039, math.log(0.16)),),
    )
    assert coefficient_lines(learnt) == [
        'learnt leak: 19 ml/h are lost at x 0.185 m, z 0.350 m',
        'learnt leak: 5 ml/h enter at x 0.100 m, z 0.200 m',
        'learnt patch of sand with permeability factor 0.16: radius 39 mm at x 0.350 m, z 0.171 m',
    ]
