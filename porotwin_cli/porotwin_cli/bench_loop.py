"""The table that decides: scenarios on the virtual rig, without control and under controllers.

Every run of a scenario is a job of its own and leaves one file, so an interrupted bench goes on
where it stopped. All figures follow from the seed, except the wall-clock times.
"""

import json
import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import cv2

from porotwin_cli import bench_loop_table
from porotwin_cli.bench_loop_rig import LoopSettings, make_eyes
from porotwin_cli.bench_loop_run import RUNS, TWINS, LoopFigures, run_closed, run_free, run_optimum
from porotwin_cli.bench_loop_scenarios import LoopScenario, draw_scenario
from porotwin_cli.terminal import duration_in_words, progress, say
from porotwin_cli.workspace import run_folder
from porotwin_core.errors import InputError

SETTINGS = 'settings.json'
"""File in the folder of a bench with everything that its figures follow from."""

SECONDS_PER_RUN = 75.0
"""One run of a scenario on one core, the mean over all kinds of runs [s]."""


@dataclass(frozen=True)
class LoopJob:
    """One run of one scenario; `file` receives its figures."""

    scenario: LoopScenario
    run: str
    settings: LoopSettings
    file: Path

    def work(self) -> None:
        """Run and write the figures; a file that exists is complete.

        Raises:
            InputError: the camera could not be calibrated.
        """
        figures = self._figures()
        part = self.file.with_suffix('.part')
        part.write_text(json.dumps(asdict(figures)), encoding='utf-8')
        part.replace(self.file)

    def _figures(self) -> LoopFigures:
        if self.run == 'none':
            return run_free(self.scenario, self.settings)
        if self.run == 'optimum':
            return run_optimum(self.scenario, self.settings)
        eyes = make_eyes(self.scenario, self.settings)
        return run_closed(self.scenario, self.settings, eyes, TWINS[self.run])


def run(
    *,
    scenarios: int = 20,
    seed: int = 1,
    workers: int | None = None,
    output: Path | None = None,
    photographs: bool = True,
    settings: LoopSettings | None = None,
    drawn: Sequence[LoopScenario] = (),
    runs: Sequence[str] = RUNS,
) -> dict[str, Any]:
    """Run all scenarios and return their figures; see `bench_loop_table.summary`.

    Args:
        scenarios: number of scenarios.
        seed: of the scenarios.
        workers: runs at a time; None: the number of cores.
        output: folder of the runs; one with runs of the same settings is continued.
        photographs: whether the twin sees photographs, or maps with noise.
        settings: how exactly the bench looks; None: the defaults.
        drawn: scenarios to run instead of drawn ones.
        runs: the runs of every scenario.

    Raises:
        InputError: the folder holds another bench, or a camera could not be calibrated.
    """
    settings = settings or LoopSettings(photographs=photographs)
    chosen = list(drawn) or [draw_scenario(number, seed) for number in range(scenarios)]
    folder = _folder(output, {'seed': seed, **asdict(settings)})
    jobs = [
        LoopJob(scenario, name, settings, folder / f'{scenario.name}_{name}.json')
        for scenario in chosen
        for name in runs
    ]
    _work([job for job in jobs if not job.file.exists()], workers or os.cpu_count() or 1)
    figures = {
        scenario.name: {
            job.run: LoopFigures(**json.loads(job.file.read_text(encoding='utf-8')))
            for job in jobs
            if job.scenario is scenario
        }
        for scenario in chosen
    }
    table = bench_loop_table.summary(chosen, figures, settings)
    (folder / 'table.json').write_text(json.dumps(table, indent=1), encoding='utf-8')
    return table


def _folder(output: Path | None, content: dict[str, Any]) -> Path:
    """Return the folder of a bench with the settings `content`; one with the same is continued.

    Raises:
        InputError: it holds something else.
    """
    text = json.dumps(content, indent=1)
    if output is not None and (output / SETTINGS).is_file():
        if (output / SETTINGS).read_text(encoding='utf-8') != text:
            raise InputError(f'{output}: holds a bench with other settings; name another --output')
        return output
    folder = run_folder(output, 'bench-loop')
    (folder / SETTINGS).write_text(text, encoding='utf-8')
    return folder


def _work(jobs: Sequence[LoopJob], workers: int) -> None:
    """Do all jobs in `workers` processes; the long ones are begun first."""
    if not jobs:
        return
    say(
        f'{len(jobs)} runs in {workers} processes, about '
        f'{duration_in_words(SECONDS_PER_RUN * len(jobs) / workers)}; '
        f'files in {jobs[0].file.parent}'
    )
    pool = ProcessPoolExecutor(workers, mp_context=get_context('spawn'), initializer=_one_thread)
    with progress() as bar:
        task = bar.add_task('runs', total=len(jobs))
        try:
            for done in as_completed([pool.submit(job.work) for job in jobs]):
                done.result()
                bar.advance(task)
        finally:
            pool.shutdown(cancel_futures=True)


def _one_thread() -> None:
    """Keep a process to its core: the processes share the machine."""
    cv2.setNumThreads(1)


show = bench_loop_table.show
