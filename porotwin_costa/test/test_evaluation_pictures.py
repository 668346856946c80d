"""Pictures of an evaluation."""

from dataclasses import replace

from porotwin_core.model.correction import Correction
from porotwin_costa.evaluation.evaluation import evaluate
from porotwin_costa.evaluation.evaluation_pictures import write_pictures


def test_curves_and_fields_are_drawn(model, unseen_frames, grid, tmp_path):
    result = evaluate(
        [unseen_frames],
        time_step=30.0,
        predict=model.predict,
        correct=model.correct,
        correction=lambda *_: Correction(None, 'no model loaded'),
        shown_times=(600.0,),
    )
    files = write_pictures(result, grid, tmp_path / 'report')
    names = {file.name for file in files}
    assert names == {'one_step.png', 'accumulated.png', 'fields_unseen_600s.png'}
    assert all(file.read_bytes().startswith(b'\x89PNG') for file in files)


def test_recordings_of_one_name_have_a_picture_each(model, unseen_frames, grid, tmp_path):
    runs = [replace(unseen_frames, name=f'/runs/{day}/bag') for day in ('monday', 'tuesday')]
    result = evaluate(
        runs,
        time_step=30.0,
        predict=model.predict,
        correct=model.correct,
        correction=lambda *_: Correction(None, 'no model loaded'),
        shown_times=(60.0,),
    )
    names = {file.name for file in write_pictures(result, grid, tmp_path)}
    assert {'fields_bag_1_60s.png', 'fields_bag_2_60s.png'} < names
