"""The error over time, in the fitted and in the held-out part."""

import numpy as np

from porotwin_diagnosis.report.error_course import error_course


def test_error_falls_in_the_fitted_and_in_the_held_out_part(denser):
    course = error_course(denser)
    sample = denser.samples[0]
    fitted = course.times < course.held_out_start
    assert course.held_out_start == sample.held_out_start
    for part in (fitted, ~fitted):
        assert np.mean(course.after[part]) < 0.6 * np.mean(course.before[part])
    assert np.all(course.floor > 0)
