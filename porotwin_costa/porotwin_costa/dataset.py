"""Training data: what the physics-based model predicted under which rates, and what it missed."""

import hashlib
import itertools
import json
import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Self

import numpy as np
import safetensors
import safetensors.numpy
from numpy.typing import NDArray

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid, fill_unseen
from porotwin_core.rig import Rig
from porotwin_core.wells import Schedule, WellRate, WellRates
from porotwin_costa.files import read_header, write_tensors
from porotwin_costa.flow_shape import FlowShape, flow_shape_of
from porotwin_costa.physics_id import PhysicsId

PredictFn = Callable[[FloatArray, WellRates, float], FloatArray]
"""(concentration, rates, time_step [s]) -> predicted concentration; uncorrected."""

ResidualFn = Callable[[FloatArray, FloatArray, WellRates, float], FloatArray]
"""(previous, next, rates, time_step [s]) -> exact residual r [1/s] (paper, eq. costa_residual)."""

FORMAT = 'porotwin-costa-dataset-1'

TIME_STEP_TOLERANCE = 0.02
"""Relative difference of a time step to the trained one that is taken for the same."""

LEAST_SEEN = 0.5
"""Share of the cells that a map must show: chart, tubes and frame always hide some of the sand."""

TOO_LITTLE_SEEN = 'pairs with too little seen'
"""Why a pair gave no sample: one of its maps shows less than `LEAST_SEEN`."""


@dataclass(frozen=True)
class Frames:
    """Observed concentration of one experiment over time.

    `times` [s] ascend; `concentration` is (time, nz, nx) with NaN where nothing is known;
    `clean_times` are when the sequence was interrupted: no pair reaches across one.
    """

    times: FloatArray
    concentration: FloatArray
    schedule: Schedule
    clean_times: tuple[float, ...] = ()
    name: str = 'experiment'


def enough_seen(concentration: FloatArray) -> bool:
    """Return whether a map (nz, nx) shows enough of the sand to learn from it or to judge by it."""
    return bool(np.isfinite(concentration).mean() >= LEAST_SEEN)


def mean_rates(schedule: Schedule, start: float, end: float) -> dict[str, WellRate]:
    """Return constant rates that pump as much water and tracer as the schedule from start to end.

    A photograph interval [s] knows one rate per well, even if a pump was changed within it. A well
    that turned from injecting to producing counts by what it injected, as far as tracer goes.
    """
    water: dict[str, float] = {}
    injected: dict[str, float] = {}
    tracer: dict[str, float] = {}
    for low, high, rates in schedule.intervals(start, end):
        share = (high - low) / (end - start)
        for name, well in rates.items():
            water[name] = water.get(name, 0.0) + share * well.rate
            injected[name] = injected.get(name, 0.0) + share * max(well.rate, 0.0)
            tracer[name] = tracer.get(name, 0.0) + share * max(well.rate, 0.0) * well.concentration
    return {
        name: WellRate(rate, tracer[name] / injected[name] if injected[name] > 0 else 0.0)
        for name, rate in water.items()
    }


def rate_vector(rates: WellRates, wells: Sequence[str]) -> FloatArray:
    """Return per well the rate and the tracer it brings, both [m^3/s], shape (wells, 2).

    Raises:
        InputError: a well pumps that is not among `wells`.
    """
    for name, well in rates.items():
        if name not in wells and well.rate != 0.0:
            raise InputError(
                f"well '{name}': COSTA knows {', '.join(wells)}; train it for this rig"
            )
    vector = np.zeros((len(wells), 2))
    for row, name in enumerate(wells):
        well = rates.get(name, WellRate())
        vector[row] = well.rate, max(well.rate, 0.0) * well.concentration
    return vector


@dataclass(frozen=True)
class Dataset:
    """Pairs (c~^{n+1}, rates) -> r^{n+1} for one rig, grid and time step.

    `flow` is that of the wells through homogeneous sand, `porosity` [-] and `relative_depth`
    [-], that relative to its mean, (nz, nx) are those of the rig.
    `predicted` [-] and `residual` [1/s] are (samples, nz, nx), float32; `rates` (samples, wells, 2)
    as `rate_vector`; `time` [s] (samples,) is when the pair ends; `experiment` (samples,) counts
    the uninterrupted sequences, which training keeps together where it can (`split_samples`).
    `dropped` says why frames gave no sample, `physics` whose
    predictions these are.
    """

    grid: Grid
    wells: tuple[str, ...]
    time_step: float
    flow: FlowShape
    porosity: FloatArray
    relative_depth: FloatArray
    predicted: NDArray[np.float32]
    rates: FloatArray
    residual: NDArray[np.float32]
    time: FloatArray
    experiment: NDArray[np.int64]
    dropped: Mapping[str, int] = field(default_factory=dict)
    sources: tuple[str, ...] = ()
    physics: PhysicsId = field(default_factory=PhysicsId)

    def __len__(self) -> int:
        return len(self.time)

    @property
    def summary(self) -> str:
        """One line for a person: how many pairs, and how many were left out and why."""
        left_out = ', '.join(f'{count} {reason}' for reason, count in self.dropped.items() if count)
        experiments = len(np.unique(self.experiment))
        text = f'{len(self)} pairs from {experiments} experiments on {self.grid}'
        return f'{text}; left out: {left_out}' if left_out else text

    @property
    def fingerprint(self) -> str:
        """SHA-256 of everything that training sees."""
        digest = hashlib.sha256(json.dumps(self._header(), sort_keys=True).encode())
        for tensor in self._tensors().values():
            digest.update(np.ascontiguousarray(tensor).tobytes())
        return digest.hexdigest()

    def select(self, samples: NDArray[np.bool_]) -> Self:
        """Return the data set of the chosen samples."""
        return replace(
            self,
            predicted=self.predicted[samples],
            rates=self.rates[samples],
            residual=self.residual[samples],
            time=self.time[samples],
            experiment=self.experiment[samples],
        )

    def _header(self) -> dict[str, object]:
        grid = self.grid
        return {
            'grid': {'nx': grid.nx, 'nz': grid.nz, 'width': grid.width, 'height': grid.height},
            'wells': list(self.wells),
            'time_step': self.time_step,
            'physics': asdict(self.physics),
        }

    def _tensors(self) -> dict[str, NDArray]:
        return {
            'predicted': self.predicted,
            'rates': self.rates,
            'residual': self.residual,
            'time': self.time,
            'experiment': self.experiment,
            'flow_right': self.flow.right,
            'flow_up': self.flow.up,
            'porosity': self.porosity,
            'relative_depth': self.relative_depth,
        }

    def save(self, path: Path) -> None:
        """Write one .safetensors file, whole or not at all."""
        header = {**self._header(), 'dropped': dict(self.dropped), 'sources': list(self.sources)}
        write_tensors(path, self._tensors(), FORMAT, header)

    def append_to(self, folder: Path) -> Path:
        """Add these samples to the data set in `folder` as one more part; return the new file.

        Each part is complete in itself, so that a reader never meets half a file and a loss of
        power costs the last part at most. Experiments keep their numbers: those of an experiment
        that goes on over several parts stay together.
        """
        folder.mkdir(parents=True, exist_ok=True)
        number = max((int(part.stem.split('_')[1]) for part in _parts(folder)), default=0) + 1
        path = folder / f'part_{number:06d}.safetensors'
        self.save(path)
        return path


def _parts(folder: Path) -> list[Path]:
    return sorted(folder.glob('part_*.safetensors'))


def empty_dataset(rig: Rig, grid: Grid, time_step: float, preset: str = '') -> Dataset:
    """Return a data set without samples for the wells of `rig`, in the order of rig.yaml.

    `preset` names the scheme of the physics-based model; empty: not known.
    """
    wells = tuple(rig.wells)
    depth = rig.field('depth_m', grid)
    return Dataset(
        grid=grid,
        wells=wells,
        time_step=time_step,
        flow=flow_shape_of(rig, grid, wells),
        porosity=rig.field('porosity', grid),
        relative_depth=depth / depth.mean(),
        predicted=np.zeros((0, *grid.shape), np.float32),
        rates=np.zeros((0, len(wells), 2)),
        residual=np.zeros((0, *grid.shape), np.float32),
        time=np.zeros(0),
        experiment=np.zeros(0, np.int64),
        physics=PhysicsId.of(rig, preset),
    )


def _consecutive(
    frames: Frames, time_step: float, dropped: Counter[str]
) -> Iterator[tuple[int, int]]:
    """Yield n and the course of time it is in, for each usable pair of frames n, n + 1.

    Others are counted by reason. An interruption begins another course of time.
    """
    known = [enough_seen(frame) for frame in frames.concentration]
    course = 0
    for n, (start, end) in enumerate(zip(frames.times, frames.times[1:], strict=False)):
        if any(start < clean <= end for clean in frames.clean_times):
            dropped['pairs across an interruption'] += 1
            course += 1
        elif not math.isclose(end - start, time_step, rel_tol=TIME_STEP_TOLERANCE):
            dropped[f'pairs not {time_step:g} s apart'] += 1
        elif known[n] and known[n + 1]:
            yield n, course
        else:
            dropped[TOO_LITTLE_SEEN] += 1


def build_dataset(
    experiments: Iterable[Frames],
    rig: Rig,
    *,
    grid: Grid,
    time_step: float,
    predict: PredictFn,
    residual: ResidualFn,
    preset: str = '',
    progress: Callable[[int], None] = lambda _: None,
) -> Dataset:
    """Return the pairs of all experiments: c~ from each frame, and what it missed of the next.

    For each pair of frames one `time_step` [s] apart: c~^{n+1} = predict(c^n) and
    r^{n+1} = residual(c^n, c^{n+1}), both under the rates of that interval (paper, section 2.2.3).
    Cells that c^n does not show are as in the last prediction before it, as the twin fills them;
    those that c^{n+1} does not show have no residual.
    A clean state within a pair's interval means that the second does not follow from the first.
    `preset` names the scheme that predicts. `progress` is told the number of samples so far.

    Raises:
        InputError: a frame is not on `grid`, or not one pair can be used.
    """
    dropped: Counter[str] = Counter()
    predicted, rates_seen, residuals, times, labels, names = [], [], [], [], [], []
    wells = tuple(rig.wells)
    label = -1
    for frames in experiments:
        if frames.concentration.shape[1:] != grid.shape:
            raise InputError(
                f'{frames.name}: maps of shape {frames.concentration.shape[1:]}, grid {grid} needs '
                f'{grid.shape}; resample them'
            )
        names.append(frames.name)
        last, last_course = -2, -1
        prediction: FloatArray | None = None
        for n, course in _consecutive(frames, time_step, dropped):
            label += n != last + 1
            prediction = prediction if course == last_course else None
            last, last_course = n, course
            start, end = float(frames.times[n]), float(frames.times[n + 1])
            before, after = (frames.concentration[k].astype(float) for k in (n, n + 1))
            rates = mean_rates(frames.schedule, start, end)
            before = fill_unseen(before, prediction)
            prediction = predict(before, rates, time_step)
            missed = residual(before, fill_unseen(after, prediction), rates, time_step)
            predicted.append(prediction.astype(np.float32))
            residuals.append(np.where(np.isfinite(after), missed, 0.0).astype(np.float32))
            rates_seen.append(rate_vector(rates, wells))
            times.append(end)
            labels.append(label)
            progress(len(times))
    if not times:
        reasons = ', '.join(f'{count} {reason}' for reason, count in dropped.items()) or 'no frames'
        raise InputError(f'{", ".join(names) or "no recording"}: no pair to learn from ({reasons})')
    return replace(
        empty_dataset(rig, grid, time_step, preset),
        predicted=np.array(predicted),
        rates=np.array(rates_seen),
        residual=np.array(residuals),
        time=np.array(times),
        experiment=np.array(labels, np.int64),
        dropped=dict(dropped),
        sources=tuple(names),
    )


def join_datasets(parts: Sequence[Dataset], *, renumber: bool = True) -> Dataset:
    """Return all samples of `parts`, which must agree on grid, wells, time step and physics.

    With `renumber`, experiments of different parts get different numbers.

    Raises:
        InputError: they do not agree; names the first difference.
    """
    first = parts[0]
    for other in parts[1:]:
        for name in ('grid', 'wells', 'time_step'):
            ours, theirs = getattr(first, name), getattr(other, name)
            if ours != theirs:
                raise InputError(f'data sets differ in {name}: {ours} and {theirs}; train apart')
    for mark, differing in itertools.combinations(dict.fromkeys(part.physics for part in parts), 2):
        if difference := mark.difference(differing):
            raise InputError(f'data sets differ in physics: {difference}; train apart')
    counts = [int(part.experiment.max(initial=-1)) + 1 for part in parts]
    offsets = np.cumsum([0, *counts]) if renumber else np.zeros(len(parts) + 1, np.int64)
    dropped: Counter[str] = Counter()
    for part in parts:
        dropped.update(part.dropped)
    return replace(
        first,
        predicted=np.concatenate([part.predicted for part in parts]),
        rates=np.concatenate([part.rates for part in parts]),
        residual=np.concatenate([part.residual for part in parts]),
        time=np.concatenate([part.time for part in parts]),
        experiment=np.concatenate(
            [part.experiment + offset for part, offset in zip(parts, offsets, strict=False)]
        ),
        dropped=dict(dropped),
        sources=tuple(dict.fromkeys(name for part in parts for name in part.sources)),
        physics=next((part.physics for part in parts if not part.physics.known), first.physics),
    )


def load_dataset(path: Path) -> Dataset:
    """Return the data set in a .safetensors file, or in a folder of parts.

    Raises:
        InputError: no such file, another format, or damaged; one line.
    """
    path = Path(path)
    if path.is_dir():
        parts = _parts(path)
        if not parts:
            raise InputError(f'{path}: holds no part_*.safetensors; build a data set first')
        return join_datasets([load_dataset(part) for part in parts], renumber=False)
    header = read_header(path, FORMAT)
    try:
        grid = Grid(**header['grid'])
        # data sets of before depth was kept took it for even
        tensors = {'relative_depth': np.ones(grid.shape), **safetensors.numpy.load_file(path)}
        return Dataset(
            grid=grid,
            wells=tuple(header['wells']),
            time_step=float(header['time_step']),
            flow=FlowShape(tensors.pop('flow_right'), tensors.pop('flow_up')),
            dropped=header['dropped'],
            sources=tuple(header['sources']),
            physics=PhysicsId(**header.get('physics', {})),
            **tensors,
        )
    except (KeyError, TypeError, safetensors.SafetensorError) as error:
        raise InputError(f'{path}: damaged data set ({error}); build it again') from None
