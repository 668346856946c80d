"""Pictures of an evaluation."""

from dataclasses import replace

import pytest

from porotwin_core.model.correction import Correction
from porotwin_costa.evaluation.evaluation import evaluate
from porotwin_costa.evaluation.evaluation_pictures import write_pictures


@pytest.mark.usefixtures('undrawn')
def test_curves_and_fields_of_each_recording_are_drawn(model, unseen_frames, grid, tmp_path):
    of_one_name = [replace(unseen_frames, name=f'/runs/{day}/bag') for day in ('monday', 'tuesday')]
    result = evaluate(
        [*of_one_name, unseen_frames],
        time_step=30.0,
        predict=model.predict,
        correct=model.correct,
        correction=lambda *_: Correction(None, 'no model loaded'),
        shown_times=(600.0,),
    )
    files = write_pictures(result, grid, tmp_path / 'report')
    fields = {f'fields_{name}_600s.png' for name in ('unseen', 'bag_1', 'bag_2')}
    assert {file.name for file in files} == {'one_step.png', 'accumulated.png', *fields}
    assert all(file.read_bytes().startswith(b'\x89PNG') for file in files)
