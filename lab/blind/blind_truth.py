"""The truth of a blinded case, as only the virtual rig knows it: its maps without noise.

A diagnosis is compared with these maps, and the virtual rig shows how strong each effect of a pair
is by itself, and whether a wrong name looks the same as the truth.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

import netCDF4
import numpy as np

from lab.blind.blind_cases import BlindCase
from lab.blind.blind_effects import equal_names
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.whole_file import write_whole
from porotwin_core.geometry.grid import FloatArray, relative_error
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.report.named_rows import named_rows
from porotwin_recording.tables.concentration import ConcentrationMaps, open_maps
from porotwin_rig.made_experiment import signals

SOLVER_FLOOR = 0.02
"""Relative L2 error that a good solver makes against maps without noise: solvers that share no
numerics differ by 1 to 2 % on fine grids."""

LEAST_GAP = 1.15
"""Errors below this many solver floors contain no measurable gap."""

EQUAL_STRENGTH = 1.1
"""Effects of a pair are equally strong if their errors, or their changes, differ by less than this
factor."""


@dataclass(frozen=True)
class CaseTruth:
    """A diagnosis compared with the virtual rig's maps without noise, over the held-out part.

    Attributes:
        before: relative L2 error of the prediction without effects.
        after: relative L2 error of the prediction with the named effects.
        strongest: the names that are right: of several the effects that close most when added
            alone, or make the largest gap alone (both can differ, because two effects can hide each
            other).
        imitation: relative L2 error of the virtual rig with the named effects in place of the true
            ones; None if the name is right by itself, or nothing was named.
    """

    before: float
    after: float
    strongest: tuple[str, ...]
    imitation: float | None = None

    @property
    def gap_closed(self) -> float | None:
        """Share of the gap above the solver floor that closes; None without a gap."""
        if not self._has_gap:
            return None
        return (self.before - self.after) / (self.before - SOLVER_FLOOR)

    @property
    def imitated(self) -> bool:
        """Whether the named effects look the same as the truth: within the solver floor.

        No model could separate both by this recording. Only a recording with a gap counts.
        """
        return self._has_gap and self.imitation is not None and self.imitation <= SOLVER_FLOOR

    @property
    def _has_gap(self) -> bool:
        return self.before >= LEAST_GAP * SOLVER_FLOOR

    def write(self, path: Path) -> None:
        """Write the figures as JSON, either completely or not at all."""
        write_whole(path, json.dumps(asdict(self), indent=1) + '\n')

    @classmethod
    def read(cls, path: Path) -> Self:
        """Return the figures in the file `path`."""
        content = json.loads(path.read_text(encoding='utf-8'))
        return cls(**{**content, 'strongest': tuple(content['strongest'])})


def truth_of(case: BlindCase, result: Path, clean: Path) -> CaseTruth:
    """Return the comparison of the diagnosis in the folder `result` with the truth of `case`.

    `clean` is the file with the maps of the recording without noise.

    Raises:
        InputError: the diagnosis predicts times that were not recorded.
    """
    with netCDF4.Dataset(result / 'fields.nc') as fields:
        held_out = np.asarray(fields['time'][:], dtype=float)
        before, after = (
            np.asarray(fields[f'predicted_{name}'][:], dtype=float) for name in ('before', 'after')
        )
    runs = _Runs(case, open_maps(clean, case.rig), held_out)
    return CaseTruth(
        before=runs.error(before),
        after=runs.error(after),
        strongest=_strongest(case, runs),
        imitation=_imitation(case, result, runs),
    )


class _Runs:
    """Runs of the virtual rig of a case with other effects than its own, over the held-out times.

    Every run stops at all times of the recording, like the true run, so that its numerical errors
    are the same.
    """

    def __init__(self, case: BlindCase, clean: ConcentrationMaps, held_out: FloatArray) -> None:
        self._case = case
        self._times = clean.times.tolist()
        self._held_out = np.isin(clean.times, held_out)
        if int(self._held_out.sum()) != len(held_out):
            raise InputError(f'{case.name}: predictions at times that were not recorded')
        self._clean = clean[:][self._held_out].astype(float)

    def maps(self, effects: Sequence[EffectDescription]) -> FloatArray:
        """Return the maps (nt, nz, nx) that a camera without noise shows with `effects`."""
        rig = self._case.virtual_rig(effects)
        grid = self._case.rig.default_grid(self._case.cell_m)
        run = signals(rig, self._case.schedule, times=self._times, grid=grid)
        return np.stack([m for (_, m), kept in zip(run, self._held_out, strict=True) if kept])

    def error(self, maps: FloatArray) -> float:
        """Return the relative L2 error of `maps` (nt, nz, nx) against the true ones."""
        return relative_error(maps, self._clean)


def _imitation(case: BlindCase, result: Path, runs: _Runs) -> float | None:
    """Return the error of the virtual rig with the named effects in place of the true ones.

    None if the name is right by itself, if there is no gap to name, or if the virtual rig cannot
    run with the named effects.
    """
    stated = json.loads((result / 'diagnosis.json').read_text(encoding='utf-8'))
    if case.kind == 'none' or stated['verdict'] in case.right or not stated['combination']:
        return None
    try:
        return runs.error(runs.maps(_named_effects(stated)))
    except InputError:
        return None


def _named_effects(stated: dict[str, Any]) -> tuple[EffectDescription, ...]:
    """Return the effects that a diagnosis kept, with its parameters."""
    return tuple(
        EffectDescription(
            name=row['name'],
            parameters={key: parameter['value'] for key, parameter in row['parameters'].items()},
        )
        for row in named_rows(stated, stated['combination'])
    )


def _strongest(case: BlindCase, runs: _Runs) -> tuple[str, ...]:
    """Return the names that are right for `case`: of several effects those of the strongest."""
    if len(case.effects) < 2:
        return case.right
    nothing = runs.maps(())
    alone = [runs.maps((effect,)) for effect in case.effects]
    errors = [runs.error(maps) for maps in alone]
    gaps = [relative_error(maps, nothing) for maps in alone]
    return tuple(
        name
        for effect, error, gap in zip(case.effects, errors, gaps, strict=True)
        if error <= EQUAL_STRENGTH * min(errors) or gap >= max(gaps) / EQUAL_STRENGTH
        for name in equal_names(effect)
    )
