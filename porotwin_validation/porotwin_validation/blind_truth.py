"""What only the virtual rig knows of a case: its maps without noise, and each effect by itself."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

import netCDF4
import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, relative_error
from porotwin_core.rig import EffectDescription
from porotwin_recording.concentration import ConcentrationMaps, open_maps
from porotwin_rig.made_experiment import signals
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_validation.blind_cases import BlindCase
from porotwin_validation.blind_effects import equal_names

SOLVER_FLOOR = 0.02
"""Relative L2 error that a good solver keeps against maps without noise."""

CLEAR_GAP = 1.15
"""Errors below this many solver floors hold no gap whose closing could be measured."""

AS_STRONG = 1.1
"""Effects of a pair whose errors left, or gaps made, alone lie within this factor are equal."""


@dataclass(frozen=True)
class Truth:
    """`before`, `after`: relative L2 error of the predictions against the maps without noise, over
    the held-out part; `strongest`: the effects that close most when added alone, or make the
    largest gap alone, which need not be the same: two effects can hide each other.

    `imitation`: the same error of the virtual rig with the effects that were said in place of the
    true ones; None where nothing was said that would have to imitate the truth to be right."""

    before: float
    after: float
    strongest: tuple[str, ...]
    imitation: float | None = None

    @property
    def gap_closed(self) -> float | None:
        """Share of the gap above what any solver leaves that is closed; None without a gap."""
        if self.before < CLEAR_GAP * SOLVER_FLOOR:
            return None
        return (self.before - self.after) / (self.before - SOLVER_FLOOR)

    @property
    def imitated(self) -> bool:
        """Whether what was said comes as near to the truth as a good solver comes to either, so
        that no model could tell them apart by this recording, and a gap was there."""
        gap = self.before >= CLEAR_GAP * SOLVER_FLOOR
        return gap and self.imitation is not None and self.imitation <= SOLVER_FLOOR

    def write(self, path: Path) -> None:
        """Write the figures as JSON, whole or not at all."""
        half = path.with_suffix('.half')
        half.write_text(json.dumps(asdict(self), indent=1) + '\n', encoding='utf-8')
        half.replace(path)

    @classmethod
    def read(cls, path: Path) -> Self:
        """Return what was written."""
        content = json.loads(path.read_text(encoding='utf-8'))
        return cls(**{**content, 'strongest': tuple(content['strongest'])})


def truth_of(case: BlindCase, result: Path, clean: Path) -> Truth:
    """Return how the predictions in `result` compare with what the virtual rig truly did, which
    `clean` holds: the maps of the recording without noise."""
    with netCDF4.Dataset(result / 'fields.nc') as fields:
        held_out = np.asarray(fields['time'][:], dtype=float)
        before, after = (
            np.asarray(fields[f'predicted_{name}'][:], dtype=float) for name in ('before', 'after')
        )
    runs = _Runs(case, open_maps(clean, case.rig), held_out)
    return Truth(
        before=runs.error(before),
        after=runs.error(after),
        strongest=_strongest(case, runs),
        imitation=_imitation(case, result, runs),
    )


class _Runs:
    """Runs of the virtual rig with other effects than the true ones of `case`, beside its true
    one, `clean`, over the `held_out` times [s].

    Every run stops at all times of the recording, as the true one did, so that its numerics are
    the same.
    """

    def __init__(self, case: BlindCase, clean: ConcentrationMaps, held_out: FloatArray) -> None:
        self._case = case
        self._times = clean.times.tolist()
        self._held_out = np.isin(clean.times, held_out)
        if int(self._held_out.sum()) != len(held_out):
            raise InputError(f'{case.name}: predictions at times that were not recorded')
        self._clean = clean[:][self._held_out].astype(float)

    def maps(self, effects: Sequence[EffectDescription]) -> FloatArray:
        """Return what a camera without noise would show with `effects`, (nt, nz, nx)."""
        rig = VirtualRig(self._case.rig, effects=effects)
        grid = self._case.rig.default_grid(self._case.cell_m)
        run = signals(rig, self._case.schedule, times=self._times, grid=grid)
        return np.stack([m for (_, m), kept in zip(run, self._held_out, strict=True) if kept])

    def error(self, maps: FloatArray) -> float:
        """Return the relative L2 error of `maps` (nt, nz, nx) against the true ones."""
        return relative_error(maps, self._clean)


def _imitation(case: BlindCase, result: Path, runs: _Runs) -> float | None:
    """Return how far the virtual rig with what was said is from the truth.

    None where the name said is right by itself, where no gap was to be named, and where the rig
    cannot do what was said.
    """
    said = json.loads((result / 'diagnosis.json').read_text(encoding='utf-8'))
    if case.kind == 'none' or said['verdict'] in case.right or not said['combination']:
        return None
    try:
        return runs.error(runs.maps(_said_effects(said)))
    except InputError:
        return None


def _said_effects(said: dict[str, Any]) -> tuple[EffectDescription, ...]:
    """Return the effects that a diagnosis kept, with the parameters it gives them."""
    rows = {row['name']: row['parameters'] for row in said['effects']}
    return tuple(
        EffectDescription(
            name=name,
            parameters={key: parameter['value'] for key, parameter in rows[name].items()},
        )
        for name in said['combination']
    )


def _strongest(case: BlindCase, runs: _Runs) -> tuple[str, ...]:
    if len(case.effects) < 2:
        return case.right
    nothing = runs.maps(())
    alone = [runs.maps((effect,)) for effect in case.effects]
    left = [runs.error(maps) for maps in alone]
    made = [relative_error(maps, nothing) for maps in alone]
    return tuple(
        name
        for effect, error, gap in zip(case.effects, left, made, strict=True)
        if error <= AS_STRONG * min(left) or gap >= max(made) / AS_STRONG
        for name in equal_names(effect)
    )
