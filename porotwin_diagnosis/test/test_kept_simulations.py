"""Simulations that an interrupted diagnosis leaves behind."""

import shutil
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from porotwin_core.basis.parallel import ThreadCrew
from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.kept_simulations import FOLDER, LEAST_FREE_BYTES, KeptSimulations, key_of

GRID = Grid(6, 4, 0.6, 0.4)


class Simulator:
    """Counts its simulations."""

    def __init__(self) -> None:
        self.count = 0

    def maps(self, level: float, *, grid: Grid) -> np.ndarray:
        if level < 0:
            raise ValueError('negative')
        self.count += 1
        return np.full(grid.shape, level, np.float32)


@pytest.fixture(autouse=True)
def _keep_everything(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(KeptSimulations, 'kept_from_s', 0.0)


def test_a_second_call_finds_the_simulations_of_the_first(tmp_path: Path) -> None:
    simulator = Simulator()
    for _ in range(2):
        with ThreadCrew(2) as threads:
            crew = KeptSimulations(threads, tmp_path / FOLDER)
            found = [crew.submit(simulator.maps, level, grid=GRID) for level in (0.1, 0.2)]
            assert [float(one.result()[0, 0]) for one in found] == pytest.approx([0.1, 0.2])
    assert (simulator.count, crew.found, crew.made, crew.kept) == (2, 2, 0, 2)
    (tmp_path / FOLDER / 'mine.txt').write_text('precious')
    crew.remove()
    assert [path.name for path in (tmp_path / FOLDER).iterdir()] == ['mine.txt']
    (tmp_path / FOLDER / 'mine.txt').unlink()
    crew.remove()
    assert not (tmp_path / FOLDER).exists()


def test_the_last_space_of_a_disk_is_left_to_the_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    little = SimpleNamespace(free=LEAST_FREE_BYTES)
    monkeypatch.setattr(shutil, 'disk_usage', lambda _: little)
    with ThreadCrew(1) as threads:
        crew = KeptSimulations(threads, tmp_path / FOLDER)
        crew.submit(Simulator().maps, 0.1, grid=GRID).result()
    assert not list((tmp_path / FOLDER).iterdir())


def test_a_damaged_file_is_made_again_and_an_error_is_passed_on(tmp_path: Path) -> None:
    simulator = Simulator()
    with ThreadCrew(1) as threads:
        crew = KeptSimulations(threads, tmp_path / FOLDER)
        crew.submit(simulator.maps, 0.1, grid=GRID).result()
        (file,) = (tmp_path / FOLDER).iterdir()
        file.write_bytes(file.read_bytes()[:140])
        assert crew.submit(simulator.maps, 0.1, grid=GRID).result().shape == GRID.shape
        with pytest.raises(ValueError, match='negative'):
            crew.submit(simulator.maps, -1.0, grid=GRID).result()
    assert simulator.count == 2


def test_the_key_tells_all_arguments_apart() -> None:
    def simulation(*_: object, **__: object) -> None: ...

    zeros, effect = np.zeros(3), EffectDescription(name='decay', parameters={'rate': 1e-4})
    calls = [
        partial(simulation, zeros, grid=GRID),
        partial(simulation, zeros, grid=Grid(6, 5, 0.6, 0.4)),
        partial(simulation, zeros + 1e-12, grid=GRID),
        partial(simulation, zeros, grid=GRID, effects=(effect,)),
        partial(simulation, zeros, grid=GRID, effects=()),
    ]
    assert len({key_of(call) for call in calls}) == len(calls)
    assert key_of(calls[3]) == key_of(partial(simulation, np.zeros(3), effects=[effect], grid=GRID))


def test_a_cancelled_task_is_cancelled(tmp_path: Path) -> None:
    task: Future[Any] = Future()

    class Busy(ThreadCrew):
        def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
            return task

    with Busy(1) as threads:
        waiting = KeptSimulations(threads, tmp_path / FOLDER).submit(
            Simulator().maps, 0.1, grid=GRID
        )
        task.cancel()
        assert waiting.cancelled()
