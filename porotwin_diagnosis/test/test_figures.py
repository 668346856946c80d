"""The figures of the report."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_results import on_rig

from porotwin_core.rig.well_colours import well_colours
from porotwin_diagnosis.report.figures import MOST_HEIGHT, course, plumes, where


@pytest.mark.parametrize(
    ('hours', 'unit', 'seconds'), [(1.0, 'min', 60.0), (30.0, 'h', 3600.0), (200.0, 'd', 86400.0)]
)
def test_the_gap_grows_per_unit_of_the_time_of_the_recording(
    coarse_denser, hours, unit, seconds
) -> None:
    sample = coarse_denser.samples[0]
    long = replace(sample, end=sample.start + 3600.0 * hours)
    figure = where(replace(coarse_denser, samples=(long,)))
    axis, bar = figure.axes
    assert bar.get_ylabel() == f'gap strength [% of stock per {unit}]'
    drawn = np.ma.getdata(axis.images[0].get_array())
    np.testing.assert_allclose(drawn, 100.0 * seconds * coarse_denser.gap.strength, rtol=1e-6)


def shaped(result, width_m: float, height_m: float):
    """Return `result` as if its rig had another shape."""
    shape = {'width_m': width_m, 'height_m': height_m}
    return on_rig(result, result.recordings[0].rig.model_copy(update=shape))


def test_a_picture_of_a_tall_rig_fits_a_screen(coarse_denser) -> None:
    for draw in (plumes, where):
        figure = draw(shaped(coarse_denser, 0.1, 0.9))
        assert figure.get_figheight() <= MOST_HEIGHT


def test_the_colour_bars_of_a_flat_rig_lie_below_its_maps(coarse_denser) -> None:
    for result, beside in ((coarse_denser, True), (shaped(coarse_denser, 1.8, 0.15), False)):
        figure = plumes(result)
        figure.draw_without_rendering()
        bars = [
            axis.get_window_extent() for axis in figure.axes if axis.get_label() == '<colorbar>'
        ]
        assert len(bars) == 2
        assert all((bar.height > bar.width) == beside for bar in bars)


def test_the_error_before_is_seen_where_both_errors_are_the_same(coarse_denser) -> None:
    before, after = course(coarse_denser).axes[0].lines
    assert before.get_zorder() == after.get_zorder()  # the later one lies above
    assert before.get_linewidth() > 2 * after.get_linewidth()


def test_a_well_has_its_own_colour_over_time(coarse_denser) -> None:
    _, rates = course(coarse_denser).axes
    colours = well_colours(coarse_denser.recordings[0].rig)
    drawn = {line.get_label(): line.get_color() for line in rates.lines}
    wells = coarse_denser.samples[0].schedule.wells
    assert {well: drawn[well] for well in wells} == {well: colours[well] for well in wells}
