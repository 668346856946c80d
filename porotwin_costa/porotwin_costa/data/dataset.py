"""Training data: predictions of the physics-based model under given rates, and their residuals."""

import hashlib
import itertools
import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rig import Rig
from porotwin_costa.data.flow_shape import FlowShape, flow_shape_of
from porotwin_costa.data.frames import PerReason, left_out
from porotwin_costa.data.physics_id import PhysicsId
from porotwin_costa.data.tensor_files import read_tensors, write_tensors

FORMAT = 'porotwin-costa-dataset-1'


@dataclass(frozen=True)
class Dataset:
    """Pairs (c~^{n+1}, rates) -> r^{n+1} for one rig, grid and time step (paper, section 2.2.3).

    The samples: `predicted` [-] and `residual` [1/s] are (samples, nz, nx), float32; `rates`
    (samples, wells, 2) holds a `frames.rate_vector` each; `time` [s] (samples,) is the end of the
    pair, `time_step` [s] the time between its states.
    `experiment` (samples,) numbers the uninterrupted sequences, which training keeps together where
    it can (`training.split_samples`).

    The rig: `flow` is the flow of the wells through homogeneous sand, `porosity` [-] (nz, nx),
    `relative_depth` (nz, nx) the depth divided by its mean [-]. `physics` identifies the model that
    predicted. `dropped` counts the pairs left out by reason, `sources` names the recordings.
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
    dropped: PerReason = field(default_factory=dict)
    sources: tuple[str, ...] = ()
    physics: PhysicsId = field(default_factory=PhysicsId)

    def __len__(self) -> int:
        return len(self.time)

    @property
    def summary(self) -> str:
        """One line for a person: the number of pairs, and of those left out with the reasons."""
        experiments = len(np.unique(self.experiment))
        text = f'{len(self)} pairs from {experiments} experiments on {self.grid}'
        reasons = left_out(self.dropped)
        return f'{text}; left out: {reasons}' if reasons else text

    @property
    def fingerprint(self) -> str:
        """SHA-256 of everything that training reads."""
        digest = hashlib.sha256(json.dumps(self.header(), sort_keys=True).encode())
        for tensor in self.tensors().values():
            digest.update(np.ascontiguousarray(tensor).tobytes())
        return digest.hexdigest()

    def select(self, samples: NDArray[np.bool_]) -> Self:
        """Return the data set of the chosen samples; `samples` has shape (samples,)."""
        return replace(
            self,
            predicted=self.predicted[samples],
            rates=self.rates[samples],
            residual=self.residual[samples],
            time=self.time[samples],
            experiment=self.experiment[samples],
        )

    def header(self) -> dict[str, object]:
        """Return grid, wells, time step and physics as JSON values."""
        grid = self.grid
        return {
            'grid': {'nx': grid.nx, 'nz': grid.nz, 'width': grid.width, 'height': grid.height},
            'wells': list(self.wells),
            'time_step': self.time_step,
            'physics': asdict(self.physics),
        }

    def tensors(self) -> dict[str, NDArray]:
        """Return all arrays by their names in a file, with shapes and units as in the class."""
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
        """Write one .safetensors file: the whole file or nothing.

        Raises:
            InputError: the file cannot be written.
        """
        header = {**self.header(), 'dropped': dict(self.dropped), 'sources': list(self.sources)}
        write_tensors(path, self.tensors(), FORMAT, header)

    def append_to(self, folder: Path) -> Path:
        """Add these samples to the data set in `folder` as one more part; return the new file.

        Each part is a complete file, so a reader never meets half a file, and a loss of power
        costs at most the last part. Experiments keep their numbers: an experiment that continues
        over several parts stays one experiment.

        Raises:
            InputError: the part cannot be written.
        """
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f'{folder}: cannot be made ({error.strerror})') from None
        number = max((int(part.stem.split('_')[1]) for part in dataset_parts(folder)), default=0)
        path = folder / f'part_{number + 1:06d}.safetensors'
        self.save(path)
        return path


def pairs_beside(model: Path) -> Path:
    """Return the file with the pairs that a model in the file `model` was trained on."""
    return model.with_name(f'{model.name}.pairs')


def newest(dataset: Dataset, count: int) -> Dataset:
    """Return the last `count` pairs."""
    return dataset.select(np.arange(len(dataset)) >= len(dataset) - count)


def dataset_parts(folder: Path) -> list[Path]:
    """Return the files of a data set that was written in parts, in their order."""
    return sorted(folder.glob('part_*.safetensors'))


def empty_dataset(rig: Rig, grid: Grid, time_step: float, preset: str = '') -> Dataset:
    """Return a data set without samples for the wells of `rig`, in the order of rig.yaml.

    `time_step` is in [s]. `preset` is the numerical scheme of the physics-based model; empty if
    unknown.
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


def join_datasets(parts: Sequence[Dataset], *, renumber: bool = True) -> Dataset:
    """Return all samples of `parts`, which must agree on grid, wells, time step and physics.

    With `renumber`, experiments of different parts get different numbers.

    Raises:
        InputError: the parts do not agree; the message names the first difference.
    """
    _check_agreement(parts)
    counts = [int(part.experiment.max(initial=-1)) + 1 for part in parts]
    offsets = np.cumsum([0, *counts]) if renumber else np.zeros(len(parts) + 1, np.int64)
    dropped: Counter[str] = Counter()
    for part in parts:
        dropped.update(part.dropped)
    return replace(
        parts[0],
        predicted=np.concatenate([part.predicted for part in parts]),
        rates=np.concatenate([part.rates for part in parts]),
        residual=np.concatenate([part.residual for part in parts]),
        time=np.concatenate([part.time for part in parts]),
        experiment=np.concatenate(
            [part.experiment + offset for part, offset in zip(parts, offsets, strict=False)]
        ),
        dropped=dict(dropped),
        sources=tuple(dict.fromkeys(name for part in parts for name in part.sources)),
        physics=next((part.physics for part in parts if not part.physics.known), parts[0].physics),
    )


def _check_agreement(parts: Sequence[Dataset]) -> None:
    first = parts[0]
    for other in parts[1:]:
        for name in ('grid', 'wells', 'time_step'):
            ours, theirs = getattr(first, name), getattr(other, name)
            if ours != theirs:
                raise InputError(f'data sets differ in {name}: {ours} and {theirs}; train apart')
    for one, another in itertools.combinations(dict.fromkeys(part.physics for part in parts), 2):
        if difference := one.difference(another):
            raise InputError(f'data sets differ in physics: {difference}; train apart')


def newest_pairs(folder: Path, most: int) -> Dataset:
    """Return the newest samples of a data set in parts: at least `most`, if there are as many.

    Raises:
        InputError: there is no part, or one is damaged or of another format.
    """
    newest: list[Dataset] = []
    for part in reversed(dataset_parts(folder)):
        newest.insert(0, load_dataset(part))
        if sum(map(len, newest)) >= most:
            break
    return join_datasets(newest, renumber=False) if newest else load_dataset(folder)


def load_dataset(path: Path) -> Dataset:
    """Return the data set in a .safetensors file, or in a folder of parts.

    Raises:
        InputError: the file is missing, damaged or of another format.
    """
    path = Path(path)
    if path.is_dir():
        parts = dataset_parts(path)
        if not parts:
            raise InputError(f'{path}: holds no part_*.safetensors; build a data set first')
        return join_datasets([load_dataset(part) for part in parts], renumber=False)
    header, found = read_tensors(path, FORMAT)
    try:
        grid = Grid(**header['grid'])
        # data sets of version 0.1 have no depth: it was assumed to be even
        tensors = {'relative_depth': np.ones(grid.shape), **found}
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
    except (KeyError, TypeError) as error:
        raise InputError(f'{path}: damaged data set ({error}); build it again') from None
