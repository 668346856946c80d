"""Damaged files for every reader: each must be read or refused with one line.

A reader may return a result or raise InputError with one line. Any other exception, a crash or a
long time is a fault. Files are damaged as disks, cables and editors do it, from a seed. Every
reader works in a process of its own, because a library may crash.
"""

import json
import multiprocessing
import os
import random
import re
import shutil
import signal
import tempfile
import warnings
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from porotwin_cli.workspace import ROOT, small_rig
from porotwin_core.basis.errors import InputError

LONGEST_S = 20
"""Longest time [s] of a reader with a small file; the process that takes longer is ended."""

BATCH = 25
"""Damaged files per process: a crash costs at most so many."""

TENSORS = 'fuzzed tensors'
"""Format of the file of weights."""

MOST_BYTES = 64
"""Most bytes that one damage changes or inserts."""

WORDS = (
    b'nan', b'inf', b'-1', b'0', b'1e300', b'1e-300', b'""', b'[]', b'{}', b'null', b'~', b'\x00',
    b'\xff\xfe', b'\n', b',', b':', b'- ', b'&a *a', b'9' * 30, b'true', '\u00b5'.encode(),
)  # fmt: skip
"""Words that readers of text like least."""

ReadFn = Callable[[Path], Any]
"""Reads a file completely."""


@dataclass(frozen=True)
class Reader:
    """A reader: `read` of the file `name` in a copy of the folder that `make` fills."""

    name: str
    make: Callable[[Path], None]
    read: ReadFn


@dataclass
class FuzzResult:
    """The outcome of one reader: counts, and the first faults with the seeds that repeat them."""

    read: int = 0
    refused: int = 0
    faults: list[str] = field(default_factory=list)

    def add(self, other: 'FuzzResult') -> None:
        """Add the outcome of a batch."""
        self.read += other.read
        self.refused += other.refused
        self.faults += other.faults


def damaged(data: bytes, seed: int) -> bytes:
    """Return `data` damaged in one or two places, from a seed."""
    draw = random.Random(seed)
    result = bytearray(data)
    for _ in range(draw.randint(1, 2)):
        change = draw.choice(TEXT_CHANGES if b'\0' not in data[:MOST_BYTES] else BYTE_CHANGES)
        result = change(draw, result)
    return bytes(result)


def _other_byte(draw: random.Random, data: bytearray) -> bytearray:
    place = draw.randrange(len(data) + 1)
    return data[:place] + bytes([draw.randrange(256)]) + data[place + 1 :]


def _cut_out(draw: random.Random, data: bytearray) -> bytearray:
    place = draw.randrange(len(data) + 1)
    return data[:place] + data[place + draw.randint(1, MOST_BYTES) :]


def _noise(draw: random.Random, data: bytearray) -> bytearray:
    place = draw.randrange(len(data) + 1)
    return data[:place] + draw.randbytes(draw.randint(1, MOST_BYTES)) + data[place:]


def _repeat(draw: random.Random, data: bytearray) -> bytearray:
    place, other = draw.randrange(len(data) + 1), draw.randrange(len(data) + 1)
    return data[:place] + data[other : other + draw.randint(1, MOST_BYTES)] + data[place:]


def _end_early(draw: random.Random, data: bytearray) -> bytearray:
    return data[: draw.randrange(len(data) + 1)]


def _other_number(draw: random.Random, data: bytearray) -> bytearray:
    """Replace a number or a word, the damage that goes deepest."""
    found = list(re.finditer(rb'[-+.\w]+', data))
    if not found:
        return data
    word = draw.choice(found)
    return data[: word.start()] + draw.choice(WORDS) + data[word.end() :]


def _other_line(draw: random.Random, data: bytearray) -> bytearray:
    lines = bytes(data).split(b'\n')
    line = draw.randrange(len(lines))
    lines[line] = draw.choice([b'', lines[line] + b'\n' + lines[line], draw.choice(WORDS)])
    return bytearray(b'\n'.join(lines))


ChangeFn = Callable[[random.Random, bytearray], bytearray]
BYTE_CHANGES: tuple[ChangeFn, ...] = (_other_byte, _cut_out, _noise, _repeat, _end_early)
TEXT_CHANGES: tuple[ChangeFn, ...] = (
    *([_other_number] * 6), *([_other_line] * 2), _other_byte, _cut_out, _noise, _end_early,
)  # fmt: skip
"""Damages of disks and cables, and of editors; a text suffers more of the latter."""


def fuzz(reader: Reader, *, tries: int, seed: int, longest_s: int = LONGEST_S) -> FuzzResult:
    """Return the outcome of `tries` damaged files, each read in at most `longest_s` [s]."""
    total = FuzzResult()
    for first in range(0, tries, BATCH):
        seeds = range(seed + first, seed + min(first + BATCH, tries))
        try:
            total.add(_read_apart(reader, seeds, longest_s))
        except BrokenProcessPool:
            for one in seeds:
                try:
                    total.add(_read_apart(reader, range(one, one + 1), longest_s))
                except BrokenProcessPool:
                    end = f'the process crashed, or read for more than {longest_s} s'
                    total.faults.append(f'seed {one}: {end}')
    return total


def _read_apart(reader: Reader, seeds: range, longest_s: int) -> FuzzResult:
    """Return what `read_damaged` returns in a process of its own.

    Raises:
        BrokenProcessPool: the process crashed, or a file took more than `longest_s` [s].
    """
    context = multiprocessing.get_context('spawn')
    with ProcessPoolExecutor(1, mp_context=context, initializer=_be_silent) as pool:
        return pool.submit(read_damaged, reader, seeds, longest_s).result()


def _be_silent() -> None:
    """Drop the complaints of libraries about every damaged file."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)


def read_damaged(reader: Reader, seeds: range, longest_s: int = 0) -> FuzzResult:
    """Return the outcome of a reader for the damages of `seeds`.

    A file that takes more than `longest_s` [s] ends this process, also within a library; 0: none
    does.
    """
    outcome = FuzzResult()
    with tempfile.TemporaryDirectory() as temporary:
        whole = Path(temporary) / 'whole'
        whole.mkdir()
        reader.make(whole)
        for seed in seeds:
            folder = Path(temporary) / str(seed)
            shutil.copytree(whole, folder)
            path = folder / reader.name
            path.write_bytes(damaged(path.read_bytes(), seed))
            signal.alarm(longest_s)
            _judge(reader, path, seed, outcome)
            signal.alarm(0)
            shutil.rmtree(folder)
    return outcome


def _judge(reader: Reader, path: Path, seed: int, outcome: FuzzResult) -> None:
    """Read one damaged file, and count it."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')
            reader.read(path)
        outcome.read += 1
    except InputError as error:
        outcome.refused += 1
        if '\n' in str(error):
            outcome.faults.append(f'seed {seed}: a refusal of several lines: {str(error)[:80]!r}')
    except Exception as error:
        outcome.faults.append(f'seed {seed}: {type(error).__name__}: {str(error)[:80]}')


# --- readers ----------------------------------------------------------------------------------


def _rig(folder: Path) -> None:
    shutil.copy(small_rig(), folder / 'rig.yaml')


def _experiment(folder: Path) -> None:
    """Write an experiment of two minutes with photographs."""
    from porotwin_core.basis.units import from_ml_h
    from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
    from porotwin_core.rig import load_rig
    from porotwin_rig.made_experiment import make_experiment
    from porotwin_rig.virtual_rig import VirtualRig

    rig = load_rig(small_rig())
    rows = [
        ScheduleRow(0.0, well, WellRate(from_ml_h(rate), 1.0))
        for well, rate in (('injector', 500.0), ('producer', -500.0))
    ]
    made = folder / 'made'
    make_experiment(
        made,
        VirtualRig(rig, cell=0.01),
        commanded=Schedule(tuple(rows)),
        duration=90.0,
        photo_interval=30.0,
        seed=1,
        grid=rig.grid(47, 28),
        photo_width_px=400,
    )
    for path in made.iterdir():
        path.replace(folder / path.name)
    made.rmdir()


def _photograph(folder: Path) -> None:
    _experiment(folder)
    photo = next((folder / 'photos').glob('state*.jpg'))
    photo.replace(folder / 'photo.jpg')


def _calibration(folder: Path) -> None:
    shutil.copy(ROOT / 'bags' / 'sample_calibration.yaml', folder / 'calibration.yaml')


def _bag(folder: Path) -> None:
    shutil.copytree(ROOT / 'bags' / 'sample', folder, dirs_exist_ok=True)


def _pumps(folder: Path) -> None:
    entries = (
        f'  {well}: {{protocol: new_era, port: /dev/ttyUSB0, address: {number}, '
        'diameter_mm: 20, max_rate_ml_h: 2500}\n'
        for number, well in enumerate(_rig_of_tests().wells)
    )
    (folder / 'pumps.yaml').write_text('pumps:\n' + ''.join(entries), encoding='utf-8')


def _foreign_table(folder: Path) -> None:
    rows = '\n'.join(f'0{n // 60}:{n % 60:02};{n},5;-{n},5' for n in range(0, 300, 7))
    (folder / 'log.csv').write_text(
        f'Zeit;Injektor [ml/h];Produzent [ml/h]\n{rows}\n', encoding='latin-1'
    )


def _foreign_maps(folder: Path) -> None:
    maps = np.linspace(0.0, 1.0, 4 * 20 * 40).reshape(4, 20, 40)
    np.savez(folder / 'maps.npz', concentration=maps, time_s=np.arange(4.0) * 60.0)


def _property_map(folder: Path) -> None:
    import netCDF4

    with netCDF4.Dataset(folder / 'depth.nc', 'w') as dataset:
        dataset.createDimension('z', 8)
        dataset.createDimension('x', 12)
        dataset.createVariable('depth', 'f8', ('z', 'x'))[:] = 0.02


def _tensors(folder: Path) -> None:
    from porotwin_costa.data.tensor_files import write_tensors

    write_tensors(folder / 'model.safetensors', {'weight': np.ones((4, 4))}, TENSORS, {'seed': 1})


def _diagnosis(folder: Path) -> None:
    effect = {'name': 'rate', 'parameters': {'factor': {'value': 0.8, 'low': 0.7, 'high': 0.9}}}
    content = {'effects': [effect], 'combination': ['rate']}
    (folder / 'diagnosis.json').write_text(json.dumps(content, indent=1), encoding='utf-8')


def _read_pumps(path: Path) -> None:
    from porotwin_pumps.pump_file import load_pumps

    load_pumps(path, _rig_of_tests())


def _read_foreign_table(path: Path) -> None:
    from porotwin_recording.importers.foreign_table import read_foreign_table

    read_foreign_table(path)


def _read_foreign_maps(path: Path) -> None:
    from porotwin_recording.importers.map_import import MapAnswers, import_maps

    import_maps(path, path.parent / 'imported', _rig_of_tests(), MapAnswers('s', first_row='top'))


def _read_property(path: Path) -> None:
    from porotwin_core.rig.property_file import read_map

    read_map(path, 'depth', 'depth_m')


def _read_tensors(path: Path) -> None:
    from porotwin_costa.data.tensor_files import read_tensors

    read_tensors(path, TENSORS)


def _read_diagnosis(path: Path) -> None:
    from porotwin_siblings.diagnosed_effects import read_diagnosis

    read_diagnosis(path)


def _rig_of_tests() -> Any:
    from porotwin_core.rig import load_rig

    return load_rig(small_rig())


def _read_rig(path: Path) -> None:
    from porotwin_core.rig import load_rig

    load_rig(path)


def _read_rates(path: Path) -> None:
    from porotwin_core.rig import load_rig
    from porotwin_recording.tables.rates import read_rates

    read_rates(path, load_rig(small_rig()).wells)


def _read_photos(path: Path) -> None:
    from porotwin_recording.tables.photos import read_photos

    for photo in read_photos(path.parent):
        photo.read()


def _read_maps(path: Path) -> None:
    from porotwin_core.rig import load_rig
    from porotwin_recording.tables.concentration import open_maps

    for frame in open_maps(path, load_rig(small_rig())):
        frame.sum()


def _read_photograph(path: Path) -> None:
    from porotwin_imaging.photograph.exposure_time import exif_time
    from porotwin_imaging.photograph.photo_file import decode

    data = path.read_bytes()
    exif_time(data)
    decode(data)


def _read_calibration(path: Path) -> None:
    from porotwin_imaging.tracer.calibration import load_calibration

    load_calibration(path)


def _read_bag(path: Path) -> None:
    from porotwin_recording.experiment.recording import open_recording

    recording = open_recording(path.parent)
    for photo in recording.photos:
        photo.read()
    if recording.maps is not None:
        for frame in recording.maps:
            frame.sum()


READERS: Mapping[str, Reader] = MappingProxyType(
    {
        'rig.yaml': Reader('rig.yaml', _rig, _read_rig),
        'rates.csv': Reader('rates.csv', _experiment, _read_rates),
        'imaging.csv': Reader('imaging.csv', _experiment, _read_photos),
        'concentration.nc': Reader('concentration.nc', _experiment, _read_maps),
        'photograph': Reader('photo.jpg', _photograph, _read_photograph),
        'calibration.yaml': Reader('calibration.yaml', _calibration, _read_calibration),
        'bag': Reader('bag_0.mcap', _bag, _read_bag),
        'pumps.yaml': Reader('pumps.yaml', _pumps, _read_pumps),
        'table of a laboratory': Reader('log.csv', _foreign_table, _read_foreign_table),
        'maps of another program': Reader('maps.npz', _foreign_maps, _read_foreign_maps),
        'map of a property': Reader('depth.nc', _property_map, _read_property),
        'weights of COSTA': Reader('model.safetensors', _tensors, _read_tensors),
        'diagnosis.json': Reader('diagnosis.json', _diagnosis, _read_diagnosis),
        'metadata.yaml of a bag': Reader('metadata.yaml', _bag, _read_bag),
    }
)
"""All readers of files by name."""
