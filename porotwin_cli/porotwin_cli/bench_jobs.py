"""Does the runs of a bench, many at a time; each leaves a file, so that a bench can go on."""

from collections.abc import Sequence
from concurrent.futures import as_completed
from pathlib import Path
from typing import Protocol

from porotwin_cli.terminal import duration_in_words, progress, say
from porotwin_core.basis.parallel import crew


class BenchJob(Protocol):
    """One run of a bench; it is sent to a process of its own."""

    @property
    def file(self) -> Path:
        """The file that the run leaves."""
        ...

    def work(self) -> None:
        """Do the run and write its file."""
        ...


def do_jobs(
    jobs: Sequence[BenchJob],
    *,
    task_bytes: float,
    seconds_per_job: float,
    workers: int | None = None,
    scheduler: str = '',
) -> None:
    """Do all `jobs` that have left no file yet, in the order given.

    Args:
        jobs: the runs; their files lie in one folder.
        task_bytes: memory of one run [B].
        seconds_per_job: usual time of one run, for the estimate [s].
        workers: runs at a time; None: one per core, as far as the memory holds.
        scheduler: address of a Dask scheduler whose workers do the runs instead.

    Raises:
        InputError: the scheduler does not answer, or its workers do not see the folder.
    """
    missing = [job for job in jobs if not job.file.exists()]
    if not missing:
        return
    pool = crew(workers=workers, scheduler=scheduler, task_bytes=task_bytes, tell=say)
    with pool, progress() as bar:
        folder = missing[0].file.parent
        pool.needs_folder(folder)
        left = seconds_per_job * len(missing) / pool.workers
        say(f'{len(missing)} runs, about {duration_in_words(left)}; files in {folder}')
        task = bar.add_task('runs', total=len(missing))
        for done in as_completed([pool.submit(job.work) for job in missing]):
            done.result()
            bar.advance(task)
