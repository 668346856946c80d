"""How far work spreads over more workers: measured on this machine, simulated on a cluster.

Simulations are timed with one and two processes. Then the task graphs of a diagnosis, of a blind
check and of many photographs are measured task by task, and `simulated_schedule` spreads them over
up to 64 workers. The last column names the bound that is reached first.
"""

import math
import tempfile
import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from lab.benches.bench_solver import bench_rig
from lab.blind.blind_cases import draw_case
from lab.blind.blind_study import make_recording
from lab.scaling.simulated_schedule import handing_seconds, longest_chain, simulated_seconds
from lab.scaling.task_trace import Away, Here, Strand, TraceCrew
from porotwin_core.basis.parallel import crew
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_diagnosis.examine import DiagnosisSettings, examine
from porotwin_imaging.baseline.baseline import make_baseline
from porotwin_imaging.photo_to_map import concentration_map
from porotwin_recording.experiment.recording import open_recording
from porotwin_rig.made_experiment import make_experiment
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_solver.model.batch import Job

WORKERS = (1, 2, 4, 8, 16, 32, 64)
"""Numbers of workers of the simulated schedules."""

PROCESSES = (1, 2)
"""Numbers of processes that are measured here."""

CASES, CASE_CELL_M = (0, 1, 7), 0.008
"""Cases of the blind check that are diagnosed here, and the width of their cells [m]: without an
effect, with one, and with two. All other cases are taken to last as long."""

ALL_CASES, ALL_PHOTOGRAPHS = 100, 1000
"""Size of the blind check and of the archive of photographs whose schedules are simulated."""

PHOTO_WIDTH_PX = 4000
"""Width of the photographs [px]; 10 megapixels."""

Row = dict[str, Any]


def run(
    simulations: int = 8,
    cell_m: float = 0.003,
    cases: Sequence[int] = CASES,
    case_cell_m: float = CASE_CELL_M,
    photo_width_px: int = PHOTO_WIDTH_PX,
) -> list[Row]:
    """Return one row per piece of work and number of workers.

    Args:
        simulations: tasks of the measured part.
        cell_m: width of their cells [m].
        cases: numbers of the blind cases that are diagnosed.
        case_cell_m: width of the cells of their maps [m].
        photo_width_px: width of the photographs [px].
    """
    jobs = _jobs(simulations, cell_m)
    jobs[0].run()  # loads the kernels
    rows = list(_measured(jobs))
    rows += _simulated(f'{simulations} simulations', _batch(jobs), PROCESSES)
    with tempfile.TemporaryDirectory(prefix='porotwin_bench_') as folder:
        traces = [_diagnosis(Path(folder), number, case_cell_m) for number in cases]
        photograph = _photograph(Path(folder), photo_width_px)
    rows += _simulated('diagnosis of one recording', traces[-1], WORKERS)
    durations = [trace.seconds(Away) + trace.seconds(Here) for trace in traces]
    check = fork(Away(durations[n % len(durations)]) for n in range(ALL_CASES))
    rows += _simulated(f'blind check of {ALL_CASES} cases', check, WORKERS)
    archive = fork([photograph] * ALL_PHOTOGRAPHS)
    return rows + _simulated(f'image {ALL_PHOTOGRAPHS} photographs', archive, WORKERS)


def fork(tasks: Iterable[Away]) -> Strand:
    """Return the trace of independent `tasks`."""
    return Strand([[Strand([task]) for task in tasks]])


def _jobs(count: int, cell_m: float) -> list[Job]:
    """Return simulations of the small rig with different rates."""
    rig = bench_rig()
    times = [60.0 * minute for minute in range(1, 41)]
    rates = [from_ml_h(400.0 + 20.0 * number) for number in range(count)]
    return [
        Job(
            rig,
            Schedule.constant({'injector': WellRate(rate, 1.0), 'producer': WellRate(-rate)}),
            times,
            rig.default_grid(cell_m),
            'fast',
        )
        for rate in rates
    ]


def _measured(jobs: Sequence[Job]) -> Iterable[Row]:
    """Yield the rows of simulations in processes of this machine."""
    first = math.nan
    for count in PROCESSES:
        with crew(workers=count) as pool:
            list(pool.map(Job.run, [jobs[0]] * count))  # each process loads the kernels
            begin = time.perf_counter()
            list(pool.map(Job.run, jobs))
            seconds = time.perf_counter() - begin
        first = seconds if count == 1 else first
        yield _row(f'{len(jobs)} simulations', 'measured', count, seconds, first, '')


def _batch(jobs: Sequence[Job]) -> Strand:
    """Return the trace of simulations, made one after the other."""
    tracer = TraceCrew()
    list(tracer.threads(len(jobs)).map(lambda job: tracer.submit(Job.run, job).result(), jobs))
    return tracer.finish()


def _diagnosis(folder: Path, number: int, cell_m: float) -> Strand:
    """Return the trace of the diagnosis of a blind case."""
    case = replace(draw_case(number, 1), cell_m=cell_m)
    make_recording(case, folder / case.name)
    recording = open_recording(folder / case.name)
    tracer = TraceCrew()
    examine([recording], DiagnosisSettings(excluded=case.withheld, crew=tracer))
    return tracer.finish()


def _photograph(folder: Path, width_px: int) -> Away:
    """Return the task of imaging one photograph."""
    rig, rate = bench_rig(), from_ml_h(500.0)
    make_experiment(
        folder / 'photographs',
        VirtualRig(rig),
        commanded=Schedule.constant({'injector': WellRate(rate, 1.0)}),
        duration=600.0,
        photo_interval=300.0,
        seed=1,
        photo_width_px=width_px,
    )
    recording = open_recording(folder / 'photographs')
    files = {role: [p.read() for p in recording.photos if p.role == role] for role in
             ('baseline', 'state')}  # fmt: skip
    baseline = make_baseline(recording.rig, recording.rig.default_grid(), files['baseline'])
    for content in files['state']:  # the first one loads the libraries
        begin = time.process_time()
        found = concentration_map(content, baseline)
        seconds = time.process_time() - begin
    return Away(seconds, float(len(content) + 3 * found.values.nbytes))


def _simulated(work: str, trace: Strand, workers: Sequence[int]) -> list[Row]:
    """Return the rows of a simulated schedule."""
    first = simulated_seconds(trace, 1)
    return [
        _row(work, 'simulated', count, simulated_seconds(trace, count), first, _bound(trace, count))
        for count in workers
    ]


def _bound(trace: Strand, workers: int) -> str:
    """Return the largest bound of the time with so many workers."""
    bounds = {
        'work of the workers': trace.seconds(Away) / workers,
        'the process that hands out': handing_seconds(trace),
        'longest chain': longest_chain(trace),
    }
    return max(bounds, key=lambda name: bounds[name])


def _row(work: str, how: str, workers: int, seconds: float, first: float, bound: str) -> Row:
    return {
        'work': work,
        'how': how,
        'workers': workers,
        'seconds': round(seconds, 1),
        'speed-up': round(first / seconds, 2),
        'efficiency': round(first / seconds / workers, 2),
        'bound by': bound,
    }
