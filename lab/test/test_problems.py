"""The problems of the field on coarse grids, and their page."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lab.verification.modflow import missing, modflow_maps
from lab.verification.problems import PROBLEMS
from lab.verification.solutions import continuous_source, henry
from porotwin_core.basis.errors import InputError
from porotwin_core.rig import load_rig
from porotwin_core.rig.oddities import remarks_about
from porotwin_recording.experiment.recording import open_recording
from porotwin_solver.model.simulation import simulate

ROOT = Path(__file__).resolve().parents[2]
KNOWN = {problem.name: problem for problem in PROBLEMS}


def test_every_rig_is_a_problem_and_none_is_odd() -> None:
    folders = {path.parent.name for path in ROOT.glob('rigs/verification/*/rig.yaml')}
    assert folders == KNOWN.keys()
    for name in KNOWN:
        remarks = remarks_about(load_rig(ROOT / 'rigs' / 'verification' / name))
        hele_shaw = name == 'salt_lake'  # a cell without sand: its porosity is 1
        assert [one.key for one in remarks] == ['porosity'] * hele_shaw


@pytest.mark.parametrize(
    ('name', 'cell_m', 'most'),
    [
        ('uniform_flow', 0.02, {'map [%]': 3.0}),
        ('push_pull', 0.02, {'map, injected [%]': 1.0, 'map, withdrawn [%]': 1.5}),
        ('dam', 0.03, {'rate, no rain [%]': 0.1, 'table [mm]': 1.5}),
        ('ditch', 0.02, {'rate [%]': 2.0}),
        pytest.param(
            'henry',
            0.0625,
            {'cells [%]': 0.5, 'toe [cm]': 1.0, 'cells, Henry [%]': 0.5, 'toe, Henry [cm]': 1.5},
            marks=pytest.mark.slow,
        ),
        (
            'sand_tank',
            0.03,
            {'wedge, SS-1 [cm]': 1.5, 'flow, SS-1 [%]': 5.0, 'flow, SS-3 [%]': 5.0},
        ),
    ],
)
def test_a_problem_is_solved(name: str, cell_m: float, most: dict[str, float]) -> None:
    problem = KNOWN[name]
    if name == 'henry':
        problem = replace(problem, options=' --times 0:24000:3000')  # it is steady by then
    errors = problem.errors(cell_m)
    for figure, limit in most.items():
        assert abs(errors[figure]) < limit, errors


def test_a_source_is_steady_where_the_plume_has_passed() -> None:
    """After a long time it is Q / (2 pi sqrt(D_L D_T)) exp(x v / (2 D_L)) K0(r v / (2 D_L))."""
    from scipy.special import k0

    along, across, velocity, x = 2e-6, 0.6e-6, 1e-4, 0.1
    (found,) = continuous_source(
        np.array([x]),
        np.array([0.0]),
        2e5,
        rate=2e-7,
        velocity=velocity,
        dispersivities=(along / velocity, across / velocity),
    )
    half = x * velocity / (2.0 * along)
    steady = 2e-7 / (2.0 * np.pi * np.sqrt(along * across)) * np.exp(half) * k0(half)
    assert found == pytest.approx(steady, rel=1e-4)


def test_henrys_solution_does_not_depend_on_its_points() -> None:
    coarse, fine = (
        henry(0.132, 0.2, 2.0, counts=n, sea_diffuses=True) for n in ((16, 10), (20, 13))
    )
    toes = [float(np.interp(0.5, c[0], x)) for x, _, c in (coarse, fine)]
    assert toes[0] == pytest.approx(toes[1], abs=0.01)


def test_modflow_6_agrees_on_a_rig_of_ours() -> None:
    """A plume in a uniform flow, on coarse cells: both schemes smear it a little."""
    if reason := missing():
        pytest.skip(f'MODFLOW 6: {reason}')
    recording = open_recording(ROOT / 'rigs' / 'verification' / 'uniform_flow')
    grid, end = recording.rig.default_grid(0.02), recording.schedule.rows[-1].time
    own = simulate(recording.rig, recording.schedule, [end], grid=grid)
    theirs = modflow_maps(
        recording.rig, recording.schedule, [end], grid=grid, longest_step=end / 100
    )
    assert np.abs(own - theirs).sum() < 0.15 * theirs.sum()
    assert own.sum() == pytest.approx(theirs.sum(), rel=0.02)


def test_a_rig_that_is_not_written_for_modflow_6_is_refused() -> None:
    if reason := missing():
        pytest.skip(f'MODFLOW 6: {reason}')
    recording = open_recording(ROOT / 'rigs' / 'verification' / 'dam')
    grid = recording.rig.default_grid(0.1)
    with pytest.raises(InputError, match='full sand'):
        modflow_maps(recording.rig, recording.schedule, [60.0], grid=grid, longest_step=60.0)
