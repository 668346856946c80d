"""Pictures of a closed-loop run."""

from pathlib import Path

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.image import imread

from porotwin_cli.pictures.run_pictures import course_picture, shown_minutes
from porotwin_cli.recorded.run_account import RunAccount, TrueTracer
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import load_rig

RIG = load_rig(Path(__file__).resolve().parents[2] / 'porotwin_hub' / 'config' / 'small_rig.yaml')


def test_the_times_are_the_papers_or_spread_over_the_run() -> None:
    assert shown_minutes(0.0, 80.0) == [10.0, 35.0, 60.0, 80.0]
    assert shown_minutes(20.0, 50.0) == [20.0, 30.0, 40.0, 50.0]
    assert shown_minutes(0.0, 160.0) == [40.0, 80.0, 120.0, 160.0]


def test_no_line_hides_another_one_of_the_same_values(tmp_path: Path) -> None:
    times, grid = np.array([0.0, 600.0, 1200.0]), RIG.grid(12, 7)
    same = [0.03, 0.02, 0.02]
    account = RunAccount(
        times=list(times),
        prediction_error=same,
        corrected_error=same,
        expected_error=[0.01] * 3,
        corrected=[True] * 3,
        cycle_s=[0.3] * 3,
        setpoint_times=list(times),
        rates=[{'injector': WellRate(1e-7)}] * 3,
    )
    truth = TrueTracer(times, grid, np.zeros((3, *grid.shape)))
    course_picture(tmp_path / 'course.png', RIG, account, truth, truth)
    drawn = imread(tmp_path / 'course.png')[..., :3]
    lines = drawn[:, : drawn.shape[1] * 3 // 4]  # without the legends
    for top, colour in ((1, '#12502f'), (1, '#b03a2e'), (2, 'C0'), (2, 'C1')):
        panel = lines[top * len(lines) // 4 : (top + 1) * len(lines) // 4]
        shown = np.abs(panel - to_rgb(colour)).max(axis=-1) < 0.02
        assert shown.sum() > 400, f'{colour} is hidden'
