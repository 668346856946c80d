"""./porotwin runs: a catalogue of recordings."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import repeat
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from porotwin_cli.terminal import Json, print_json, print_table, progress, say, without_warnings
from porotwin_core.basis.plain_text import plain

if TYPE_CHECKING:
    from porotwin_recording.experiment.catalogue import CatalogueEntry
    from porotwin_recording.experiment.told_lines import ToldLine

RUNS = Path('runs')
"""Folder of the runs by default; it is made by the first run."""

HASH_DIGITS = 8
"""Digits of a calibration's hash in the table; --json has all."""

BY_INDEX = '‡'
"""Mark of the states of bags: reading each chunk of a day would take 86,000 reads."""

OF_FILES = '†'
"""Mark of a date that comes from the files of a recording."""

NOTHING = '-'


def command(
    folder: Annotated[Path, typer.Argument(help='Folder with recordings.')] = RUNS,
    find: Annotated[
        str,
        typer.Option(
            help='Only runs that said these words, such as control2: in remarks of their cycles, '
            'warnings of their nodes, or the verdict. Reads the bags, which takes longer.'
        ),
    ] = '',
    as_json: Json = False,
) -> None:
    """List the bags and experiment folders below a folder, the oldest first.

    The command reads the indexes of the recordings, and opens no photograph and no map. The verdict
    is from the newest report on a recording in this folder. The rig of a rehearsed recording has
    the word "virtual". An unreadable recording gives one line.

    Example: ./porotwin runs /data/rig1

    Example: ./porotwin runs --find "control2 seems to deliver"
    """
    from porotwin_recording.experiment.catalogue import (
        catalogue_entry,
        find_recordings,
        without_copies,
    )
    from porotwin_recording.experiment.experiment_folder import is_experiment
    from porotwin_recording.experiment.known_verdicts import KnownVerdicts

    with without_warnings(), progress() as bar:  # ./porotwin check tells odd things
        begun = folder != RUNS or folder.exists()
        paths = list(find_recordings(folder)) if begun else []
        task = bar.add_task('recordings', total=len(paths))
        # the report on a single recording may lie beside it
        verdicts = KnownVerdicts(folder.absolute().parent if folder in paths else folder)
        entries = []
        with ThreadPoolExecutor() as pool:
            bags = [path for path in paths if not is_experiment(path)]
            for entry in pool.map(catalogue_entry, bags, repeat(verdicts)):
                entries.append(entry)
                bar.advance(task)
        for path in filter(is_experiment, paths):  # the NetCDF library has no threads
            entries.append(catalogue_entry(path, verdicts))
            bar.advance(task)
    entries = sorted(without_copies(entries), key=_order)
    told: dict[Path, list[ToldLine]] = {}
    if find:
        told = {entry.path: _lines_about(entry, find) for entry in entries}
        entries = [entry for entry in entries if told[entry.path]]
    if as_json:
        shown = [
            {**_as_json(entry), 'told': [one._asdict() for one in told.get(entry.path, [])]}
            for entry in entries
        ]
        print_json({'folder': folder, 'recordings': shown})
        return
    if find and not entries:
        print(f"{folder}: no run said '{find}'")
        return
    if not entries:
        print(f'{folder}: no bag or experiment folder' if begun else _no_runs(folder))
        return
    readable = [entry for entry in entries if entry.state != 'unreadable']
    columns = [
        (title, [words(entry) or NOTHING for entry in readable])
        for title, words in _columns(folder).items()
    ]
    filled = [(title, cells) for title, cells in columns if set(cells) != {NOTHING}]
    if filled:
        titles, cells = zip(*filled, strict=True)
        count = f'{len(readable)} recording{"s" * (len(readable) != 1)}'
        rows = zip(*cells, strict=True)
        print_table(f'{count} in {folder}', titles, rows, whole=('diagnosed', 'size'))
        if 'photos*' in titles:
            print('* without baselines')
        if any(entry.kind == 'bag' for entry in readable):
            print(f'{BY_INDEX} of a bag: by the index at its end; reading it shows earlier damage')
        if any(entry.start is None for entry in readable):
            print(f'{OF_FILES} date of its files, as it tells none itself; copies may be younger')
    for entry in entries:
        for remark in entry.remarks:
            say(plain(remark))
        for line in told.get(entry.path, []):
            times = f' ({line.times} times)' if line.times > 1 else ''
            when = clock_words(max(line.time_s, 0.0))
            print(f'{_name(entry.path, folder)}, {when}: {plain(line.text)}{times}')


def _lines_about(entry: 'CatalogueEntry', words: str) -> 'list[ToldLine]':
    """Return the lines of a run with `words`, and its verdict if that has them."""
    from porotwin_recording.experiment.told_lines import ToldLine, lines_about

    verdict = [ToldLine(entry.duration_s, f'diagnosed: {entry.diagnosed}', 1)]
    found = verdict if words.casefold() in entry.diagnosed.casefold() else []
    readable = entry.kind == 'bag' and entry.state not in ('unreadable', 'compressed')
    return found + (lines_about(entry.path, words) if readable else [])


def _no_runs(folder: Path) -> str:
    """Say where the command looked, and what else it can look at."""
    return (
        f'no runs yet in {folder.absolute()}; name a folder with recordings, such as . for this one'
    )


def _columns(folder: Path) -> 'dict[str, Callable[[CatalogueEntry], str]]':
    """Return the titles of the columns and their words; a column without words is left out."""
    return {
        'recording': lambda entry: _name(entry.path, folder),
        'date (UTC)': _date,
        'duration': lambda entry: clock_words(entry.duration_s),
        'rig': lambda entry: f'{entry.rig}, virtual' if entry.virtual else entry.rig,
        'photos*': lambda entry: str(entry.photographs or ''),
        'maps': lambda entry: str(entry.maps or ''),
        'setpoints': lambda entry: str(entry.setpoints or ''),
        'effects': lambda entry: ', '.join(entry.effects),
        'diagnosed': lambda entry: entry.diagnosed,
        'COSTA': lambda entry: entry.costa.partition(',')[0],
        'calibration': lambda entry: entry.calibration[:HASH_DIGITS],
        'state': _state,
        'size': lambda entry: size_words(entry.size_bytes),
    }


def _date(entry: 'CatalogueEntry') -> str:
    if entry.date is None:
        return ''
    return f'{entry.date:%Y-%m-%d %H:%M}{"" if entry.start else OF_FILES}'


def _name(path: Path, folder: Path) -> str:
    return plain(str(path.relative_to(folder)) if path != folder else path.name)


def _state(entry: 'CatalogueEntry') -> str:
    state = entry.state + BY_INDEX * (entry.kind == 'bag')
    return f'{state}, {entry.files} files' if entry.files > 1 else state


def _order(entry: 'CatalogueEntry') -> tuple[bool, float, str]:
    """Return the key of the order by time; recordings without a time come last."""
    return entry.date is None, entry.date.timestamp() if entry.date else 0.0, str(entry.path)


def _as_json(entry: 'CatalogueEntry') -> dict[str, Any]:
    dates = {'start': entry.start, 'files_date': entry.files_date, 'date': entry.date}
    texts = {name: date and date.isoformat(timespec='seconds') for name, date in dates.items()}
    return {**vars(entry), **texts}


def clock_words(seconds: float) -> str:
    """Return a duration as hours and minutes, or as minutes and seconds below an hour."""
    whole = round(seconds)
    if whole >= 3600:
        return f'{whole // 3600} h {whole % 3600 // 60:02d} min'
    return f'{whole // 60} min {whole % 60:02d} s'


def size_words(size_bytes: int) -> str:
    """Return a size with three digits."""
    for unit, factor in (('TB', 1e12), ('GB', 1e9), ('MB', 1e6), ('kB', 1e3)):
        if size_bytes >= 0.9995 * factor:  # 999.5 kB has three digits as 1 MB only
            return f'{size_bytes / factor:.3g} {unit}'
    return f'{size_bytes} B'
