"""Tubes and cables laid before the sand are found; plumes, grains and noise are none."""

import cv2
import numpy as np
import pytest

from porotwin_imaging.baseline.thin_objects import thin_objects
from porotwin_imaging.numerics.cell_sums import BlockSums, cell_sums
from porotwin_imaging.photo_to_map import concentration_map
from porotwin_imaging.photograph.linear_light import LINEAR_LIGHT

ACROSS = 6
SHAPE = (50, 90)


def blocks(change: np.ndarray) -> BlockSums:
    """Return the sums of a photograph: grains times `change` (rows, columns) at every sample."""
    generator = np.random.default_rng(8)
    size = (SHAPE[0] * ACROSS, SHAPE[1] * ACROSS)
    grains = 0.2 * (1 + 0.2 * generator.normal(size=size).clip(-2, 2))
    light = grains * change * (1 + 0.03 * generator.normal(size=size))
    levels = np.searchsorted(LINEAR_LIGHT, light).clip(0, 255).astype(np.uint8)
    pixels = np.repeat(levels[..., None], 3, axis=2)
    baseline = np.repeat(grains[..., None], 3, axis=2).astype(np.float32)
    usable = np.ones(size, np.uint8)
    return cell_sums(
        pixels,
        baseline,
        usable,
        light=LINEAR_LIGHT,
        matrix=np.eye(3),
        glare_level=250,
        samples_across=ACROSS,
    ).blocks


def samples() -> tuple[np.ndarray, np.ndarray]:
    rows, columns = np.mgrid[: SHAPE[0] * ACROSS, : SHAPE[1] * ACROSS]
    return rows, columns


@pytest.mark.parametrize('width', [1, 2])
def test_a_thin_tube_is_found(width: int) -> None:
    change = np.ones((SHAPE[0] * ACROSS, SHAPE[1] * ACROSS))
    cv2.line(change, (60, 20), (400, 260), 0.2, width)
    crossed = cv2.resize(change, SHAPE[::-1], interpolation=cv2.INTER_AREA) < 0.95
    found = thin_objects(blocks(change))[::-1]
    assert found[crossed].mean() > 0.85
    assert found.mean() < 0.15


def test_the_edge_of_a_plume_is_no_tube() -> None:
    rows, columns = samples()
    distance = np.hypot(rows - 150, columns - 270)
    for rim in (1.0, 4.0):
        plume = np.exp(-1.5 / (1 + np.exp((distance - 90) / rim)))
        assert not thin_objects(blocks(plume)).any()
    assert not thin_objects(blocks(np.ones_like(distance))).any()


def test_nothing_is_found_where_nothing_is_seen() -> None:
    empty = BlockSums(*(np.zeros((5, 8, 3), np.float32),) * 5, np.zeros((5, 8), np.float32))
    assert not thin_objects(empty).any()


def test_a_cable_on_a_photograph_has_no_value(baseline, laboratory, no_tracer, make_jpeg) -> None:
    light = np.ascontiguousarray(laboratory.scene(no_tracer))
    cv2.line(light, (150, 200), (600, 560), (0.02, 0.02, 0.02), 2, cv2.LINE_AA)
    found = concentration_map(make_jpeg(light), baseline)
    assert any('% of the sand is covered or damaged' in line for line in found.status)
    assert np.isnan(found.values).mean() < 0.1
    assert np.nanmean(found.values) < 0.002
