"""A study: many runs into one folder, which can be interrupted and continued; then a row for each.

A run is a job that leaves a file. A job whose file exists is done.
"""

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, wait
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

from pydantic import TypeAdapter

from porotwin_cli.terminal import duration_in_words, progress, say
from porotwin_cli.workspace import run_folder
from porotwin_core.basis.parallel import Crew, crew
from porotwin_core.basis.whole_file import write_whole

LOOK_EACH_S = 2.0
"""Time between two looks at the parts of jobs that are done [s]."""

IN_WORK = 'jobs in work'
"""The event that some part of a job was done."""

Figures = TypeVar('Figures')

JobProgress = Callable[[float, str], None]
"""Called with the jobs that are done, parts of jobs included, and the event."""


class StudyJob(ABC):
    """One run of a study; it is sent to a process of its own.

    Attributes:
        file: the file that the run leaves, whole or not at all.
        did: the word for a run that is done.
    """

    file: Path
    did: ClassVar[str] = 'done'

    @abstractmethod
    def work(self) -> None:
        """Do the run and write its file."""

    @property
    def name(self) -> str:
        """The name of the run."""
        return self.file.stem

    def share(self) -> float:
        """Return the share of the work that is done while it is in work, if the run tells it."""
        return 0.0


class FiguresJob(StudyJob, Generic[Figures]):
    """A run whose file holds its figures, a dataclass, as JSON.

    Attributes:
        kind: the class of the figures.
    """

    kind: ClassVar[type[Any]]

    @abstractmethod
    def figures(self) -> Figures:
        """Do the run and return its figures."""

    def work(self) -> None:
        """Do the run and write its figures."""
        found: Any = self.figures()
        write_whole(self.file, json.dumps(asdict(found)))

    def found(self) -> Figures:
        """Return the figures of a run that is done."""
        figures: Figures = TypeAdapter(self.kind).validate_json(self.file.read_bytes())
        return figures


@dataclass(frozen=True)
class Study:
    """The folder of a study, and who does its runs.

    Attributes:
        folder: an existing folder.
        task_bytes: memory of one run [B].
        workers: runs at a time; None: one per core, as far as the memory holds.
        scheduler: address of a Dask scheduler whose workers do the runs instead.
        tell: called with a line about the workers.
    """

    folder: Path
    task_bytes: float
    workers: int | None = None
    scheduler: str = ''
    tell: Callable[[str], None] = say

    def do(self, jobs: Sequence[StudyJob], *, seconds_per_job: float) -> None:
        """Do all `jobs` that have left no file yet, in the order given, and show the progress.

        `seconds_per_job` is the usual time of one run [s], for the estimate.

        Raises:
            InputError: the scheduler does not answer, or its workers do not see the folder.
            SchedulerLost: the scheduler went away; the same call goes on.
        """
        missing = missing_jobs(jobs)
        if not missing:
            return
        with self.crew() as pool, progress() as bar:
            left = seconds_per_job * len(missing) / pool.workers
            say(f'{len(missing)} runs, about {duration_in_words(left)}; files in {self.folder}')
            task = bar.add_task('runs', total=len(missing))
            work_through(missing, pool, lambda done, _: bar.update(task, completed=done))

    @contextmanager
    def crew(self) -> Iterator[Crew]:
        """Return workers that all see the folder, for the time of the context.

        Raises:
            InputError: the scheduler does not answer, or its workers do not see the folder.
        """
        with crew(
            workers=self.workers,
            scheduler=self.scheduler,
            task_bytes=self.task_bytes,
            tell=self.tell,
        ) as pool:
            pool.needs_folder(self.folder)
            yield pool


def missing_jobs(jobs: Sequence[StudyJob]) -> list[StudyJob]:
    """Return the jobs that have left no file yet."""
    return [job for job in jobs if not job.file.exists()]


def work_through(
    jobs: Sequence[StudyJob],
    pool: Executor,
    progress: JobProgress,
    *,
    forgiven: tuple[type[Exception], ...] = (),
) -> set[str]:
    """Do `jobs` in `pool`, which is shut down, and return the names of those that failed.

    An interrupt, or an error that is not `forgiven`, ends the jobs that have not begun.
    """
    failed = set()
    try:
        futures = {pool.submit(job.work): job for job in jobs}
        done, waiting = 0, set(futures)
        while waiting:
            finished, waiting = wait(waiting, LOOK_EACH_S, FIRST_COMPLETED)
            for future in finished:
                done, job = done + 1, futures[future]
                try:
                    future.result()
                except forgiven:
                    failed.add(job.name)
                progress(done, f'{job.name} {"failed" if job.name in failed else job.did}')
            if not finished:
                progress(done + sum(futures[one].share() for one in waiting), IN_WORK)
    finally:
        pool.shutdown(cancel_futures=True)
    return failed


def study_folder(output: Path | None, command: str, holds: Callable[[Path], bool]) -> Path:
    """Return `output` if it `holds` an earlier part of the study, else a new folder.

    Raises:
        InputError: `output` holds something else.
    """
    if output is not None and holds(output):
        return output.resolve()
    return run_folder(output, command)
