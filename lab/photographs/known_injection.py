"""The calibration from photographs of a known injection, as `calibrate` makes it."""

from functools import partial
from pathlib import Path

from porotwin_imaging.calibrating.calibration_fit import (
    CalibrationFit,
    InjectionSource,
    fit_calibration,
)
from porotwin_imaging.calibrating.calibration_trust import CalibrationRefused, refusal
from porotwin_recording.experiment.experiment_folder import folder_data
from porotwin_solver.model.plume_model import plume_model


def fit_of_injection(folder: Path) -> CalibrationFit:
    """Return the fit to the photographs and rates of the recording in `folder`.

    Raises:
        CalibrationRefused: the calibration cannot be trusted.
        InputError: a photograph cannot be used.
    """
    data = folder_data(folder)
    schedule = data.measured or data.commanded
    fit = fit_calibration(
        data.rig,
        [photo.read() for photo in data.photos if photo.role == 'baseline'],
        [(photo.time, photo.read()) for photo in data.photos if photo.role == 'state'],
        schedule=schedule,
        plumes=partial(plume_model, data.rig, schedule) if schedule else None,
        source=InjectionSource(folder.name),
    )
    if any(one.refused for one in fit.remarks):
        raise CalibrationRefused(refusal(fit.remarks))
    return fit
