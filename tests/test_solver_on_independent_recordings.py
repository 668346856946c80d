"""The solver with the true effects reproduces the recordings of an independent simulator.

The simulations run free from the start. The error is the relative L2 norm of the difference over
the last 30 % of a recording. The maps are noisy; `noise_floor` is the error of the noise alone.
"""

from pathlib import Path

import numpy as np
import pytest
import yaml

from porotwin_core.rig import EffectDescription, load_rig
from porotwin_recording.experiment.recording import open_recording
from porotwin_solver.model.batch import Job, simulate_many

CASES = (2, 5, 9, 10, 11, 12, 13, 15, 16, 17, 18, 20, 22)
"""A recording without effect, and one of each physical effect. The effects of the camera leave the
model as it is."""


@pytest.fixture
def cases() -> Path:
    """The recordings of the independent simulator; skipped where they are absent."""
    folder = Path(__file__).resolve().parents[2] / 'shared' / 'cases'
    if not folder.is_dir():
        pytest.skip(f'needs the recordings of the independent simulator in {folder}')
    return folder


def job_and_truth(folder: Path) -> tuple[Job, dict, np.ndarray]:
    """Return the simulation with the true effects, the truth, and the recorded maps."""
    truth = yaml.safe_load((folder / 'truth.yaml').read_text(encoding='utf-8'))
    recording = open_recording(folder)
    assert recording.maps is not None
    maps = np.array(list(recording.maps))
    effects = tuple(
        EffectDescription.model_validate(
            {'name': effect['name'], 'parameters': effect['parameters']}
        )
        for effect in truth['effects']
    )
    rig = load_rig(folder)
    grid = rig.grid(maps.shape[2], maps.shape[1])
    job = Job(rig, recording.schedule, np.asarray(recording.times), grid, effects=effects)
    return job, truth, maps


def held_out_error(job: Job, found: np.ndarray, maps: np.ndarray) -> float:
    """Return the relative L2 error over the last 30 % of the recording's time."""
    times = np.asarray(job.times)
    late = times >= times[0] + 0.7 * (times[-1] - times[0])
    observed, model = maps[late], found[late]
    there = np.isfinite(observed)
    return float(np.linalg.norm((model - observed)[there]) / np.linalg.norm(observed[there]))


def table(cases: Path, numbers) -> list[tuple[int, str, float, float]]:
    """Return case, effects, error and noise floor of every case; print them."""
    loaded = [job_and_truth(cases / f'case_{number:03d}') for number in numbers]
    found = simulate_many([job for job, _, _ in loaded])
    rows = []
    print(f'\n{"case":>4} {"effect":26} {"error":>7} {"floor":>7} {"ratio":>6}')
    for number, (job, truth, maps), simulated in zip(numbers, loaded, found, strict=True):
        names = '+'.join(effect['name'] for effect in truth['effects']) or 'none'
        error, floor = held_out_error(job, simulated, maps), truth['figures']['noise_floor']
        rows.append((number, names, error, floor))
        print(f'{number:4d} {names:26} {error:7.4f} {floor:7.4f} {error / floor:6.3f}')
    return rows


@pytest.mark.slow
def test_the_true_effects_explain_a_recording_of_each_kind(cases) -> None:
    for number, names, error, floor in table(cases, CASES):
        limit = 1.1 if names == 'none' else 1.15
        assert error <= limit * floor, f'case {number}, {names}: {error:.4f} of {floor:.4f}'
