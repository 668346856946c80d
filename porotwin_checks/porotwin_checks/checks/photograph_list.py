"""Does the list of photographs name each once, with a baseline before the tracer?"""

import itertools
from collections import defaultdict
from collections.abc import Iterator
from pathlib import PurePosixPath

import numpy as np

from porotwin_checks.known import Known
from porotwin_core.basis.check import Check
from porotwin_core.basis.remark import Remark, first_of
from porotwin_core.basis.units import MINUTE_S

TWICE = (
    'several lines name {names}; keep one line of each: a photograph is a baseline, or shows tracer'
)


def _find(known: Known) -> Iterator[Remark]:
    yield from _twice(known)
    baselines = [photo.time for photo in known.photos if photo.role == 'baseline']
    if not baselines:
        why = 'no photograph has the role baseline: sand and water only'
        yield Remark(
            'imaging.csv', '', why, 'give the first photograph this role', code='no_baseline'
        )
    elif max(baselines) > (tracer := min(_with_tracer(known), default=np.inf)):
        why = f'a baseline comes after the tracer, there from {tracer:g} s on'
        shown, remedy = f'{max(baselines):g} s', 'compare roles, and the clocks of camera and pumps'
        yield Remark('imaging.csv', shown, why, remedy, code='late_baseline')
    states = [photo for photo in known.photos if photo.role == 'state']
    same = [pair for pair in itertools.pairwise(states) if pair[0].time == pair[1].time]
    if same:
        first, second = same[0]
        why = f'{first.name} and {second.name} have the same time of {first.time:g} s'
        remedy = 'correct one time'
        if len(same) > 1:
            why += f', and {len(same) - 1} more pairs likewise'
        if all(photo.time % MINUTE_S == states[0].time % MINUTE_S for photo in states):
            remedy = 'a table program may have dropped the seconds; write them again'
        yield Remark('imaging.csv', '', why, remedy, code='same_time')


def _twice(known: Known) -> Iterator[Remark]:
    """Yield a remark if lines name the same file, however they spell its path."""
    roles = defaultdict(list)
    for photo in known.photos:
        roles[PurePosixPath(photo.name)].append(photo.role)
    twice = {str(path): found for path, found in roles.items() if len(found) > 1}
    if twice:
        told = [f'{path} ({" and ".join(found)})' for path, found in twice.items()]
        facts = {'names': first_of(told), 'roles': twice}
        yield Remark.of('imaging.csv', 'listed_twice', TWICE, **facts)


def _with_tracer(known: Known) -> Iterator[float]:
    """Yield the times [s] of photographs with tracer, and of rows that inject it."""
    yield from (photo.time for photo in known.photos if photo.role == 'state')
    rows = known.commanded.rows if known.commanded is not None else ()
    yield from (row.time for row in rows if row.rate.rate > 0 and row.rate.concentration > 0)


CHECK = Check(needs=('photos',), find=_find)
