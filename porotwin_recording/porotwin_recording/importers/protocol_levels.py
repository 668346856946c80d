"""The levels of `level_protocol.csv`, the log of a water level, in any unit of length."""

from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import MINUTE_S
from porotwin_core.rig.checks.heads import remarks_about_heads
from porotwin_core.rig.sections import LevelCourse
from porotwin_recording.importers.foreign_table import bare_title, read_foreign_table
from porotwin_recording.importers.foreign_units import length_factor, unit_in
from porotwin_recording.importers.protocol_answers import ProtocolAnswers, protocol_moments
from porotwin_recording.importers.protocol_rates import START
from porotwin_recording.importers.words_of_languages import plain
from porotwin_recording.tables.recorded_data import RecordedData


def with_logged_levels(
    path: Path, data: RecordedData, begin: datetime, answers: ProtocolAnswers, told: list[str]
) -> RecordedData:
    """Return `data` whose rig has the levels of a log, as means around each minute after `begin`.

    Each column with the name of an open side or of `water` holds its level.

    Raises:
        InputError: no column names water with a head, or a level is far from its head.
    """
    table = read_foreign_table(path, answers.decimal)
    moments = protocol_moments(table, table.needed(*START), answers, told)
    seconds = np.array([(moment - begin).total_seconds() for moment in moments])
    heads = {n: w.head_m for n, w in data.rig.water_bodies.items() if w.head_m is not None}
    bare = {plain(name): name for name in heads}
    found: dict[str, LevelCourse] = {}
    for title in (one for one in table.columns if bare_title(one) in bare):
        table.only([one for one in table.columns if bare_title(one) == bare_title(title)])
        name = bare[bare_title(title)]
        where = f'{path}: {table.spelt(title)}'
        levels = length_factor(unit_in(title), where) * np.array(table.numbers(title))
        found[name] = _course(seconds, levels, where)
        now = found[name].points[0][1]
        told.append(f'{where}: {now:.4g} m at time zero, in rig.yaml {heads[name]:g} m')
    if not found:
        raise InputError(
            f'{path}: no column is named as water with a head; rename one, such as '
            f"'{next(iter(heads), 'left')} [cm]'. Its columns are {table.titles}; the rig has "
            f'{", ".join(heads) or "no heads: give boundaries.heads_m"}'
        )
    rig = data.rig.model_copy(update={'levels': {**data.rig.levels, **found}})
    for remark in remarks_about_heads(rig):
        if remark.refused:
            raise InputError(f'{path}: {remark}')
    return replace(data, rig=rig)


def _course(seconds: np.ndarray, levels: np.ndarray, where: str) -> LevelCourse:
    """Return the course of `levels` [m] at `seconds` after time zero, in any order.

    Raises:
        InputError: the log ends before time zero.
    """
    _, part, counts = np.unique(  # models know the mean of each minute only
        np.round(seconds / MINUTE_S), return_inverse=True, return_counts=True
    )
    times, means = (np.bincount(part, values) / counts for values in (seconds, levels))
    if times[-1] < 0.0:
        raise InputError(f'{where}: ends before time zero; compare the clocks')
    later = times > 0.0
    # to a micrometre: no round-off in rig.yaml
    known = np.array([np.interp(0.0, times, means), *means[later]]).round(6)
    minutes = np.array([0.0, *times[later]]) / MINUTE_S
    return LevelCourse(points=tuple(zip(minutes.tolist(), known.tolist(), strict=True)))
