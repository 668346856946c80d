"""One experiment on disk as a lab keeps it: rig.yaml, rates.csv, concentration.nc, photographs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from porotwin_core.errors import InputError
from porotwin_core.rig import Rig, load_rig, write_rig
from porotwin_core.wells import Schedule
from porotwin_recording.concentration import ConcentrationMaps, ConcentrationWriter, open_maps
from porotwin_recording.photos import Photo, read_photos, write_photos
from porotwin_recording.rates import read_rates, write_rates

FILES = ('rates.csv', 'rates_measured.csv', 'concentration.nc', 'imaging.csv')
"""What may lie beside rig.yaml: told and (in the same form) delivered rates, maps, photographs."""


@dataclass(frozen=True)
class Experiment:
    """What an experiment folder holds; None or empty where a file is not there."""

    rig: Rig
    told: Schedule | None
    measured: Schedule | None
    maps: ConcentrationMaps | None
    photos: tuple[Photo, ...]
    remarks: tuple[str, ...] = ()


def read_experiment(folder: Path, rig: Rig | None = None) -> Experiment:
    """Return the experiment in `folder`; a given `rig` takes the place of its rig.yaml.

    Maps and photographs stay on disk until they are asked for.

    Raises:
        InputError: one line naming the file, the line or value, and what would mend it.
    """
    if not folder.is_dir():
        raise InputError(f'{folder}: no such folder; name an experiment folder')
    if rig is None:
        rig = load_rig(folder)
    rates, measured, maps, photos = (folder / name for name in FILES)
    if not (rates.exists() or maps.exists() or photos.exists()):
        raise InputError(
            f'{folder}: not an experiment folder; it has none of rates.csv, concentration.nc, '
            'imaging.csv'
        )
    if not photos.exists() and (folder / 'photos').is_dir():
        raise InputError(f'{folder}: has photos/ but no imaging.csv, which gives their times')
    return Experiment(
        rig,
        read_rates(rates, rig.wells) if rates.exists() else None,
        read_rates(measured, rig.wells) if measured.exists() else None,
        open_maps(maps, rig) if maps.exists() else None,
        read_photos(folder) if photos.exists() else (),
    )


def write_experiment(
    folder: Path,
    *,
    rig: Rig,
    told: Schedule | None = None,
    measured: Schedule | None = None,
    maps: ConcentrationMaps | None = None,
    photos: Sequence[Photo] = (),
    packed: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write an experiment folder; maps go frame by frame, `packed` in 8 bits (a coarser map).

    `progress` is told how many of how many maps and photographs are done.

    Raises:
        InputError: the folder already holds an experiment, or something in it cannot be written.
    """
    if any((folder / name).exists() for name in ('rig.yaml', *FILES)):
        raise InputError(f'{folder}: holds an experiment already; name another folder')
    total = len(photos) + (len(maps) if maps is not None else 0)
    folder.mkdir(parents=True, exist_ok=True)
    write_rig(rig, folder / 'rig.yaml')
    if told is not None:
        write_rates(folder / 'rates.csv', told)
    if measured is not None:
        write_rates(folder / 'rates_measured.csv', measured)
    if maps is not None:
        with ConcentrationWriter(folder / 'concentration.nc', maps.grid, packed=packed) as writer:
            for number, (time, frame) in enumerate(zip(maps.times, maps, strict=True)):
                writer.append(time, frame)
                if progress:
                    progress(number + 1, total)
    if photos:
        write_photos(folder, photos)
        if progress:
            progress(total, total)
