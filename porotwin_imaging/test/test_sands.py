"""The segmentation of sands, and the factors that make their signals continuous."""

import numpy as np
import pytest

from porotwin_imaging.calibrating import sands

NZ, NX = 100, 180


def layered() -> np.ndarray:
    labels = np.zeros((NZ, NX), np.uint8)
    labels[40:65] = 1
    labels[85:] = 2
    return labels


def appearance(labels: np.ndarray, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    generator = np.random.default_rng(seed)
    brightness = np.array([0.12, 0.28, 0.19])[labels]
    rough = np.array([0.2, 0.05, 0.11])[labels]
    vignette = 1 - 0.3 * np.linspace(-1, 1, NX)[None, :] ** 2
    grains = 1 + 0.2 * rough * generator.normal(size=labels.shape)
    colours = (brightness * vignette * grains)[..., None] * [1.0, 0.7, 0.5]
    return colours, rough * (1 + 0.1 * generator.normal(size=labels.shape))


def covered(found: np.ndarray, truth: np.ndarray) -> float:
    """Return the share of cells whose label stands for the true sand that it covers most."""
    labels = range(int(found.max()) + 1)
    same = [(found == n) & (truth == np.bincount(truth[found == n]).argmax()) for n in labels]
    return float(np.logical_or.reduce(same).mean())


def test_layers_are_separated_under_a_vignette() -> None:
    truth = layered()
    found = sands.segment(*appearance(truth), np.ones(truth.shape, bool))
    assert found.max() == 2
    assert covered(found, truth) > 0.98


def test_one_sand_is_one_sand() -> None:
    truth = np.zeros((NZ, NX), np.uint8)
    assert sands.segment(*appearance(truth), np.ones(truth.shape, bool)).max() == 0


@pytest.mark.parametrize('layers', [False, True])
def test_two_lamps_are_no_sands(layers: bool) -> None:
    truth = layered() if layers else np.zeros((NZ, NX), np.uint8)
    colours, rough = appearance(truth)
    z, x = np.mgrid[-1 : 1 : NZ * 1j, -1 : 1 : NX * 1j]
    lamps = sum(np.exp(-((x - at) ** 2) / 0.08 - z**2 / 0.6) for at in (-0.6, 0.6))
    found = sands.segment(colours * (0.4 + lamps)[..., None], rough, np.ones(truth.shape, bool))
    assert found.max() == truth.max()
    assert covered(found, truth) > 0.97


def test_hidden_cells_take_the_nearest_sand() -> None:
    truth = layered()
    visible = np.ones(truth.shape, bool)
    visible[50, :] = False
    found = sands.segment(*appearance(truth), visible)
    assert (found[50] == found[48]).mean() > 0.98


EVEN_LIGHT = np.zeros(3)


@pytest.mark.parametrize('factors', [(1.0, 1.5, 1.2), (1.0, 0.8, 1.0)])
def test_factors_make_the_signal_continuous(factors) -> None:
    labels = layered()
    x, z = np.meshgrid(np.linspace(-1, 1, NX), np.linspace(-1, 1, NZ))
    concentration = 0.5 * (1 - np.tanh((np.hypot(x, 0.5 * z) - 0.7) / 0.1))
    signal = concentration / np.array(factors)[labels]
    signal += np.random.default_rng(5).normal(0, 0.01, signal.shape)
    found = sands.fit_factors([signal], labels, {}, strong=1.0, lights=EVEN_LIGHT)
    relative = np.array(found.values) / found.values[0]
    # the prior draws sands of even light together
    np.testing.assert_allclose(relative, np.array(factors) / factors[0], rtol=0.13)
    assert found.jump_after < found.jump_before
    assert set(found.sources) == {'interface'}


def test_a_core_outweighs_the_interfaces() -> None:
    labels = layered()
    signal = np.full(labels.shape, 0.5)
    levels = {0: sands.SandLevel(1.0, 0.01, 500), 1: sands.SandLevel(0.8, 0.01, 100)}
    found = sands.fit_factors([signal], labels, levels, strong=0.5, lights=EVEN_LIGHT)
    assert found.values[0] == 1.0
    assert found.values[1] == pytest.approx(1.25, rel=0.03)
    assert found.sources == ('core', 'core', 'interface')


def test_a_sand_without_evidence_follows_its_light_and_says_so() -> None:
    labels = layered()
    signal = np.random.default_rng(5).normal(0, 0.01, labels.shape)
    signal[10:30, 40:90] += 0.8  # tracer that touches no interface
    levels = {0: sands.SandLevel(0.8, 0.01, 500)}
    lights = np.log([0.1, 0.2, 0.1])
    found = sands.fit_factors([signal], labels, levels, strong=0.8, lights=lights)
    assert found.values[0] == found.values[2] == 1.0
    assert 1.3 < found.values[1] < 1.7
    assert found.sources == ('core', 'prior', 'prior')
    assert found.deviations[1] > 10 * found.deviations[0]


def test_noise_across_an_interface_gives_no_factor() -> None:
    """Faint light on both sides of an interface once made a sand 38 times stronger."""
    labels = layered()
    generator = np.random.default_rng(5)
    signal = np.abs(generator.normal(0, 0.02, labels.shape))
    signal[labels == 1] /= 40
    signal[10:30, 40:90] = 0.8
    levels = {0: sands.SandLevel(0.8, 0.01, 500)}
    found = sands.fit_factors([signal], labels, levels, strong=0.8, lights=EVEN_LIGHT)
    assert found.values == (1.0, 1.0, 1.0)


def test_factors_stay_inside_their_bounds() -> None:
    labels = layered()
    levels = {0: sands.SandLevel(1.0, 0.01, 500), 1: sands.SandLevel(0.05, 0.01, 100)}
    found = sands.fit_factors(
        [np.ones(labels.shape)], labels, levels, strong=1.0, lights=EVEN_LIGHT
    )
    assert found.values[1] == pytest.approx(2.5)
    assert found.at_bound == (False, True, False)


def test_the_light_of_a_sand_does_not_follow_the_lamps() -> None:
    truth = layered()
    colours, _ = appearance(truth)
    lights = sands.sand_lights(colours, truth, np.ones(truth.shape, bool))
    np.testing.assert_allclose(
        np.exp(lights - lights[0]), np.array([0.12, 0.28, 0.19]) / 0.12, rtol=0.03
    )


@pytest.mark.parametrize('lamps', ['corners', 'one side', 'two sides'])
def test_lamps_are_no_sands(lamps: str) -> None:
    rows, columns = np.mgrid[-0.5:0.5:80j, -0.5:0.5:150j]
    fall_off = {
        'corners': 1 / (1 + 1.5 * (rows**2 + columns**2)) ** 2,
        'one side': np.exp(-1.2 * columns),
        'two sides': 0.4 + 0.6 * (np.abs(columns) * 2) ** 2,
    }[lamps]
    noise = np.random.default_rng(6).normal(0, 0.03, (2, 80, 150))
    colours = 0.2 * (fall_off * np.exp(noise[0]))[..., None] * np.array([1.0, 0.8, 0.6])
    labels = sands.segment(colours, 0.1 * np.exp(noise[1]), np.ones((80, 150), bool))
    assert labels.max() == 0
