"""The form of a remainder: what a physicist would say is missing."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import SMALL

from porotwin_core.wells import Schedule
from porotwin_diagnosis.advice.remainder_form import GLOW_RADIUS, describe_remainder
from porotwin_diagnosis.data.noise import Noise
from porotwin_diagnosis.data.sample import Sample

GRID = SMALL.grid(70, 42)
TIMES = np.linspace(120.0, 2400.0, 20)
WELL = (0.3, 0.25)


def plume(x, z, times, *, slower=0.0):
    """Return the concentration of a disc around the well that grows with the root of time."""
    radius = 0.13 * np.sqrt(times * (1.0 - slower) / TIMES[-1])
    distance = np.hypot(x - WELL[0], z - WELL[1])
    return 0.5 * (1.0 - np.tanh((distance - radius) / 0.012))


def maps(change=lambda x, z, t: (x, z), **options):
    """Return maps (nt, nz, nx) whose tracer at (x, z) comes from `change` of that place."""
    x, z = np.meshgrid(GRID.x, GRID.z)
    return np.stack([plume(*change(x, z, t), t, **options) for t in TIMES])


def sample_of(observed):
    """Return a sample of `observed` maps, 14 frames of which are fitted."""
    noisy = observed + 0.005 * np.random.default_rng(7).standard_normal(observed.shape)
    return Sample(
        rig=SMALL,
        schedule=Schedule(()),
        grid=GRID,
        times=TIMES,
        observed=noisy,
        fitted_frames=14,
        noise=Noise(0.0, 0.005, 0.005),
        start=0.0,
        held_out_start=1700.0,
        end=2400.0,
    )


def pushed(x, z, t, *, place=(0.36, 0.28), area=6e-4):
    """Return from where a source at `place` has pushed the tracer."""
    away_x, away_z = x - place[0], z - place[1]
    share = area * t / TIMES[-1] / (away_x**2 + away_z**2 + 0.04**2)
    return x - share * away_x, z - share * away_z


GLOW = 0.15 * np.exp(-0.5 * (np.hypot(*np.meshgrid(GRID.x - 0.5, GRID.z - 0.3)) / 0.036) ** 2)

CASES = {
    'camera: displaced': (maps(lambda x, z, t: (x - 0.006, z + 0.004)), 'displaced'),
    'transport: drifting': (maps(lambda x, z, t: (x, z + 0.012 * t / 2400)), 'drifting'),
    'storage: delayed': (maps(slower=0.06), 'delayed'),
    'storage: fading': (maps() * (1 - 0.2 * TIMES / 2400)[:, None, None], 'fading'),
    'camera: paler': (0.9 * maps(), 'paler'),
    'camera: glow': (maps() + GLOW, 'glow'),
    'source: water': (maps(pushed), 'source'),
}


@pytest.mark.parametrize('case', CASES)
def test_the_kind_of_a_remainder_is_found(case):
    observed, name = CASES[case]
    form = describe_remainder(sample_of(observed), maps())
    assert f'{form.kind}' == case.split(':')[0]
    assert form.terms[0].name == name
    assert form.closed > 0.35
    assert len(form.terms) <= 3


def test_the_place_and_the_size_are_told():
    form = describe_remainder(sample_of(CASES['source: water'][0]), maps())
    assert form.terms[0].place == pytest.approx((0.36, 0.28), abs=0.05)
    assert 'water enters near x =' in form.terms[0].words
    form = describe_remainder(sample_of(CASES['camera: glow'][0]), maps())
    assert form.terms[0].place == pytest.approx((0.5, 0.3), abs=0.03)
    fitted, true = form.terms[0].amount * (GLOW_RADIUS * SMALL.width_m) ** 2, 0.15 * 0.036**2
    assert fitted == pytest.approx(true, rel=0.3), 'the radius is not fitted'
    form = describe_remainder(sample_of(CASES['storage: delayed'][0]), maps())
    assert form.terms[0].amount == pytest.approx(0.06, rel=0.25)
    assert 'fronts move' in form.terms[0].words


def test_a_remainder_without_a_form_is_refused():
    """Every frame is wrong in its own way."""
    generator = np.random.default_rng(2)
    jumps = generator.normal(0.0, 0.008, (len(TIMES), 2))
    turn = dict(zip(TIMES, jumps, strict=True))
    observed = maps(lambda x, z, t: (x + turn[t][0], z + turn[t][1]))
    form = describe_remainder(sample_of(observed), maps())
    assert form.terms == ()
    assert form.kind is None
    unseen = replace(sample_of(observed), observed=np.full_like(observed, np.nan))
    assert describe_remainder(unseen, maps()).terms == ()
