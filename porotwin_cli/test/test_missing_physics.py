"""The diagnosis finds the missing physics for COSTA."""

from pathlib import Path

import pytest
from diagnosis_examples import SMALL, recorded

from porotwin_cli.recorded.missing_physics import missing_physics
from porotwin_core.basis.parallel import ThreadCrew
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.progress import no_progress
from porotwin_recording.experiment.recording import open_recording


def _found(path: Path) -> tuple[tuple[EffectDescription, ...], list[str]]:
    told: list[str] = []
    with ThreadCrew(1) as crew:
        recording = open_recording(path)
        found = missing_physics([recording], crew=crew, say=told.append, progress=no_progress)
    return found, told


def test_a_recording_that_is_too_short_shows_no_physics(experiment: Path) -> None:
    found, (line,) = _found(experiment)
    assert found == ()
    assert str(experiment) in line


@pytest.mark.slow
def test_sorption_is_found_as_a_change(tmp_path: Path) -> None:
    causes = (EffectDescription(name='retardation', parameters={'retardation_factor': 1.4}),)
    (change,), told = _found(
        recorded(tmp_path / 'recording', *causes, grid=SMALL.grid(25, 15), duration=1350, cell=0.01)
    )
    assert change.name == 'retardation'
    assert change.parameters['retardation_factor'] == pytest.approx(1.4, rel=0.05)  # wide cells
    assert 'sorbs' in told[-1]
