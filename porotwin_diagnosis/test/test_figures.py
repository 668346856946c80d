"""The figures of the report."""

from dataclasses import replace

import numpy as np
import pytest

from porotwin_diagnosis.report.figures import where


@pytest.mark.parametrize(
    ('hours', 'unit', 'seconds'), [(1.0, 'min', 60.0), (30.0, 'h', 3600.0), (200.0, 'd', 86400.0)]
)
def test_the_gap_grows_per_unit_of_the_time_of_the_recording(denser, hours, unit, seconds) -> None:
    sample = denser.samples[0]
    long = replace(sample, end=sample.start + 3600.0 * hours)
    figure = where(replace(denser, samples=(long,)))
    axis, bar = figure.axes
    assert bar.get_ylabel() == f'gap strength [% of stock per {unit}]'
    drawn = np.ma.getdata(axis.images[0].get_array())
    np.testing.assert_allclose(drawn, 100.0 * seconds * denser.gap.strength, rtol=1e-6)
