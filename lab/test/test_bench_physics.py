"""The bench of withheld effects: the same draws every time, and a row for each training."""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np

from lab.benches.bench_physics import CASES, PhysicsFigures, deviation, jobs_of, row


def test_every_case_is_learnt_from_four_recordings_and_from_a_part_of_one(tmp_path: Path) -> None:
    jobs = jobs_of(tmp_path, draws=2, seed=5)
    assert len({job.file for job in jobs}) == len(jobs) == 3 * 2 * len(CASES)
    ours = [job for job in jobs if job.network == 'hybrid' and job.draw == 0]
    assert sorted(job.case for job in ours if job.part) == sorted(CASES)


def test_another_seed_has_other_files(tmp_path: Path) -> None:
    first, second = (jobs_of(tmp_path, draws=1, seed=seed) for seed in (1, 2))
    assert {job.file for job in first}.isdisjoint(job.file for job in second)


def test_the_draws_depend_on_the_seed_only(tmp_path: Path) -> None:
    def effects(seed: int) -> list[object]:
        return [job.effects() for job in jobs_of(tmp_path, draws=1, seed=seed)]

    assert effects(5) == effects(5) != effects(6)
    assert effects(5)[:2] == [(), ()]


def test_a_row_holds_the_ratio_of_the_errors(tmp_path: Path) -> None:
    job = jobs_of(tmp_path, draws=1, seed=5)[0]
    figures = PhysicsFigures(0.2, 0.05, 0.3, 0.06, 0.5, 0.01, None, 'gate open', 90.0, 4.0)
    job.file.write_text(json.dumps(asdict(figures)), encoding='utf-8')
    assert row(job)['ratio'] == 0.25


def test_full_tracer_is_less_certain_than_water() -> None:
    water, tracer = deviation(np.array([[0.0, 1.0]]))[0]
    assert 0.0 < water < tracer < 0.02
