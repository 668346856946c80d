"""Tests of announced pauses on their way through a bag."""

import json
from pathlib import Path

import pytest
from recording_examples import controlled_rig

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import Control, FixedWell, Rig
from porotwin_recording.experiment.bag_conversion import export_bag, import_experiment
from porotwin_recording.experiment.experiment_folder import write_folder
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.experiment.rig_pauses import with_pauses
from porotwin_recording.tables.recorded_data import RecordedData

PAUSES = ((15.0, 20.0), (35.0, 40.5))


def control_of(rig: Rig) -> Control:
    assert rig.control is not None
    return rig.control


def rig_with(pauses: tuple[tuple[float, float], ...]) -> tuple[Rig, str]:
    """Return a rig whose only fixed well has `pauses` [min], and the name of this well."""
    control = control_of(rig := controlled_rig())
    name = next(iter(control.fixed))
    well = FixedWell(
        rate_ml_h=control.fixed[name].rate_ml_h,
        concentration=control.fixed[name].concentration,
        pauses_min=pauses,
    )
    told = control.model_copy(update={'fixed': {**control.fixed, name: well}})
    return rig.model_copy(update={'control': told}), name


@pytest.mark.parametrize('bag', ['run', 'run.mcap'])
def test_pauses_survive_the_way_through_a_bag(tmp_path: Path, bag: str) -> None:
    rig, name = rig_with(PAUSES)
    rates = Schedule((ScheduleRow(0.0, name, WellRate(1e-8, 1.0)),))
    write_folder(tmp_path / 'experiment', RecordedData(rig=rig, commanded=rates))
    import_experiment(tmp_path / 'experiment', tmp_path / bag)
    assert control_of(open_recording(tmp_path / bag).rig).fixed[name].pauses_min == PAUSES
    export_bag(tmp_path / bag, tmp_path / 'back')
    assert control_of(open_recording(tmp_path / 'back').rig).fixed[name].pauses_min == PAUSES


def test_a_bag_of_version_0_2_has_its_pauses_in_a_text() -> None:
    rig, name = rig_with(())
    assert with_pauses(rig, '') is rig
    told = with_pauses(rig, json.dumps({name: PAUSES}))
    assert control_of(told).fixed[name].pauses_min == PAUSES


@pytest.mark.parametrize(
    'text', ['{', '[]', '{"nobody": [[1, 2]]}', '{"WELL": [[2, 1]]}', '{"WELL": 3}']
)
def test_a_text_that_does_not_fit_is_told(text: str) -> None:
    rig, name = rig_with(())
    with pytest.raises(InputError, match='do not fit its wells'):
        with_pauses(rig, text.replace('WELL', name))
