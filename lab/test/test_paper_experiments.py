"""The paper's experiments on the virtual rig; a small one runs to its end."""

import json
from pathlib import Path

import numpy as np
import pytest

from lab import paper_experiments
from lab.paper_experiments import PaperExperiment, observed, run
from porotwin_cli.running.rehearsal import balanced
from porotwin_cli.workspace import small_rig
from porotwin_core.rig import load_rig


@pytest.fixture
def small() -> PaperExperiment:
    rig = load_rig(small_rig())
    grid = rig.grid(32, 18)
    schedule = balanced([(0.0, 'injector', 500.0, 1.0)], 'producer')
    frames = observed(rig, grid, schedule, duration=900.0, interval=30.0, number=0, cell=0.03)
    return PaperExperiment(rig, grid, 'upwind', 30.0, [frames], frames, ('paper',), (600.0,))


@pytest.mark.slow
def test_a_small_experiment_gives_pictures_and_a_row(
    small: PaperExperiment, tmp_path: Path
) -> None:
    (row,) = run(lambda: small, tmp_path, seed=1)
    assert row['network'] == 'paper'
    assert 0 < row['free run, end, model'] < 1
    assert row['free run, end, COSTA'] <= 1.05 * row['free run, end, model']
    assert (tmp_path / 'paper' / 'accumulated.png').is_file()
    assert json.loads(json.dumps(row)) == row


def test_pulses_of_the_large_rig_do_not_overlap() -> None:
    starts = np.array(paper_experiments.PULSES_H)
    assert (np.diff(starts) > 0.5).all()
