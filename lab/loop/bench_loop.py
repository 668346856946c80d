"""The table that decides: scenarios on the virtual rig, without control and under controllers.

Every run of a scenario is a job of its own and leaves one file, so an interrupted bench goes on
where it stopped. All figures follow from the seed, except the wall-clock times.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar

from pydantic import TypeAdapter

from lab.loop import bench_loop_table
from lab.loop.bench_loop_draw import draw_scenario
from lab.loop.bench_loop_eyes import BenchSettings, make_eyes
from lab.loop.bench_loop_run import RUNS, TWINS, run_free, run_optimum
from lab.study import FiguresJob, Study, StudyJob, study_folder
from porotwin_cli.running.loop_run import LoopFigures, run_closed
from porotwin_cli.running.loop_scenario import LoopScenario
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import TASK_BYTES
from porotwin_core.basis.whole_file import write_whole

SETTINGS = 'settings.json'
"""File in the folder of a bench with everything that its figures follow from."""

SECONDS_PER_RUN = 75.0
"""One run of a scenario on one core, the mean over all kinds of runs [s]."""


SCENARIOS = TypeAdapter(LoopScenario)
"""Converts scenarios from and to JSON."""

SECONDS_PER_DRAW = 20.0
"""Drawing of one scenario on one core [s]."""


@dataclass(frozen=True)
class DrawJob(StudyJob):
    """Draws one scenario; `file` receives it."""

    number: int
    seed: int
    file: Path

    def work(self) -> None:
        """Draw and write the scenario; a file that exists is complete."""
        scenario = SCENARIOS.dump_json(draw_scenario(self.number, self.seed))
        write_whole(self.file, scenario.decode())

    def scenario(self) -> LoopScenario:
        """Return the scenario that was drawn."""
        return SCENARIOS.validate_json(self.file.read_bytes())


@dataclass(frozen=True)
class LoopJob(FiguresJob[LoopFigures]):
    """One run of one scenario; `file` receives its figures."""

    scenario: LoopScenario
    run: str
    settings: BenchSettings
    file: Path
    kind: ClassVar = LoopFigures

    def figures(self) -> LoopFigures:
        """Run and return the figures.

        Raises:
            InputError: the camera could not be calibrated.
        """
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
    scheduler: str = '',
    output: Path | None = None,
    photographs: bool = True,
    settings: BenchSettings | None = None,
    drawn: Sequence[LoopScenario] = (),
    runs: Sequence[str] = RUNS,
) -> dict[str, Any]:
    """Run all scenarios and return their figures; see `bench_loop_table.summary`.

    Args:
        scenarios: number of scenarios.
        seed: of the scenarios.
        workers: runs at a time; None: one per core, as far as the memory holds.
        scheduler: address of a Dask scheduler that does the runs instead of this machine.
        output: folder of the runs; one with runs of the same settings is continued.
        photographs: whether the twin sees photographs, or maps with noise on coarser grids.
        settings: how exactly the bench looks; None: the defaults.
        drawn: scenarios to run instead of drawn ones.
        runs: the runs of every scenario.

    Raises:
        InputError: the folder holds another bench, or a camera could not be calibrated.
        SchedulerLost: the scheduler went away; the same call goes on.
    """
    settings = settings or (BenchSettings() if photographs else BenchSettings.quick())
    folder = _folder(output, {'seed': seed, **asdict(settings)})
    study = Study(folder, TASK_BYTES, workers, scheduler)
    draws = [
        DrawJob(number, seed, folder / f'drawn_{number + 1:02d}.json')
        for number in range(0 if drawn else scenarios)
    ]
    study.do(draws, seconds_per_job=SECONDS_PER_DRAW)
    chosen = list(drawn) or [draw.scenario() for draw in draws]
    jobs = [
        LoopJob(scenario, name, settings, folder / f'{scenario.name}_{name}.json')
        for scenario in chosen
        for name in runs
    ]
    study.do(jobs, seconds_per_job=SECONDS_PER_RUN)
    figures = {
        scenario.name: {job.run: job.found() for job in jobs if job.scenario is scenario}
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

    def holds(folder: Path) -> bool:
        file = folder / SETTINGS
        if file.is_file() and json.loads(file.read_text(encoding='utf-8')) != content:
            raise InputError(f'{folder}: holds a bench with other settings; name another --output')
        return file.is_file()

    folder = study_folder(output, 'bench-loop', holds)
    (folder / SETTINGS).write_text(json.dumps(content, indent=1), encoding='utf-8')
    return folder


show = bench_loop_table.show
