"""The dear functions of a search, remembered: a search with other rules makes most fits again.

A function is remembered by its arguments. Fitters count by their corrections, point spreads and
noise, fits by their parameters, so that the answer is the one that the function would give.
"""

import hashlib
import pickle
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from functools import wraps
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from lab.stored.changed_numbers import PACKAGE, Changes
from porotwin_diagnosis.kept_simulations import described

METHODS = {
    f'{PACKAGE}.model.fitter': ('Fitter', ('fit', 'evaluate', 'distance', 'with_covariance'))
}
"""Classes with remembered methods, by their modules."""

FUNCTIONS = {
    f'{PACKAGE}.data.sample': ('read_sample',),
    f'{PACKAGE}.decision.held_out': ('measure_held_out',),
    f'{PACKAGE}.model.polishing': ('polished',),
    f'{PACKAGE}.search.effect_sets': ('linear_sets',),
    f'{PACKAGE}.search.levels': ('own_point_spread_width',),
    f'{PACKAGE}.search.place_scan': ('promising_starts',),
}
"""Remembered functions by their modules."""

INNER = (
    'porotwin_core',
    'porotwin_solver',
    f'{PACKAGE}.data',
    f'{PACKAGE}.decision.held_out',
    f'{PACKAGE}.model',
    f'{PACKAGE}.search.effect_sets',
    f'{PACKAGE}.search.place_scan',
)
"""Modules whose numbers change the answers of these functions."""

LEVELS = {'POINT_SPREAD_RANGE', 'POINT_SPREAD_TOLERANCE', 'TYPICAL_POINT_SPREAD', 'JUDGING'}
"""Numbers of the levels that change them too."""

Memory = dict[str, bytes]
"""Pickled answers by their arguments."""


def inner_names() -> set[str]:
    """Return the names of the constants in the modules that answer."""
    modules = [module for name, module in sys.modules.items() if _is_inner(name)]
    return {key for module in modules for key in vars(module) if key.isupper()} | LEVELS


def inner_changes(changes: Changes) -> str:
    """Return the part of `changes` that changes remembered answers, and the program, as a key."""
    files = [str(module.__file__) for name, module in sys.modules.items() if _is_inner(name)]
    program = hashlib.sha256(b''.join(Path(file).read_bytes() for file in sorted(files)))
    inner = inner_names()
    answers = {name: value for name, value in changes.items() if name in inner}
    return described((answers, program.hexdigest()))


def _is_inner(module: str) -> bool:
    return module.startswith(INNER)


def remember(modules: dict[str, ModuleType], memory: Callable[[], Memory], key: str) -> None:
    """Make the dear functions of `modules` of the package remember their answers in `memory()`."""
    for module, (owner, names) in METHODS.items():
        kind = getattr(modules[module], owner)
        for name in names:
            setattr(kind, name, _remembering(getattr(kind, name), memory, key))
    for module, functions in FUNCTIONS.items():
        for name in functions:
            old = getattr(modules[module], name)
            new = _remembering(old, memory, key)
            for other in modules.values():
                if getattr(other, name, None) is old:
                    setattr(other, name, new)


def _remembering(
    function: Callable[..., Any], memory: Callable[[], Memory], key: str
) -> Callable[..., Any]:
    @wraps(function)
    def remembered(*args: Any, **kwargs: Any) -> Any:
        text = ' '.join(_marks((function.__qualname__, key, args, sorted(kwargs.items()))))
        call = hashlib.sha256(text.encode()).hexdigest()
        known = memory()
        if call not in known:
            known[call] = pickle.dumps(function(*args, **kwargs))
        return pickle.loads(known[call])

    return remembered


def _marks(value: Any) -> Iterator[str]:
    """Yield texts that are equal for arguments that give equal answers."""
    kind = type(value).__name__
    if kind == 'Levels':
        yield from _marks((value.screening, value.refining, value.judging))
    elif kind == 'Fitter':
        yield f'noise {value.noise_share}'
        yield from _marks(tuple(value.forwards))
    elif kind == 'Forward':
        yield _forward_mark(value)
    elif kind == 'Fit':
        yield from _marks((value.members, value.scaled_parameters, value.held_out_parameters))
    elif kind == 'Recording':
        yield str(value.source)
    elif kind == 'Sample':
        yield str(value.grid.shape)
    elif kind == 'SearchSpace' or isinstance(value, Executor):
        yield kind
    elif isinstance(value, tuple | list):
        yield f'{len(value)}:'
        for item in value:
            yield from _marks(item)
    else:
        yield described(value)


def _forward_mark(forward: Any) -> str:
    known = forward.__dict__.get('_mark')
    if known is None:
        sample = forward.sample
        frames = np.asarray(sample.times)
        known = described(
            (
                forward.preset,
                forward.refinement,
                forward.point_spread_width,
                None if forward.correction is None else np.asarray(forward.correction),
                sample.grid.shape,
                frames,
                sample.fitted_frames,
            )
        )
        object.__setattr__(forward, '_mark', known)
    return str(known)
