"""What only the virtual rig knows of a case: its maps without noise, and each effect by itself."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Self

import netCDF4
import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, relative_error
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.blind_cases import BlindCase
from porotwin_diagnosis.blind_effects import equal_names
from porotwin_rig.asset import VirtualRig
from porotwin_rig.experiment import signals

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
    true ones; None where none were said."""

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


def truth_of(case: BlindCase, result: Path) -> Truth:
    """Return how the predictions in `result` compare with what the virtual rig truly did."""
    with netCDF4.Dataset(result / 'fields.nc') as fields:
        times = np.asarray(fields['time'][:], dtype=float)
        before, after = (
            np.asarray(fields[f'predicted_{name}'][:], dtype=float) for name in ('before', 'after')
        )
    clean = _maps(case, case.effects, times)
    said = _said_effects(result)
    return Truth(
        before=relative_error(before, clean),
        after=relative_error(after, clean),
        strongest=_strongest(case, clean, times),
        imitation=_imitation(case, said, clean, times) if said else None,
    )


def _imitation(
    case: BlindCase, said: Sequence[EffectDescription], clean: FloatArray, times: FloatArray
) -> float | None:
    """Return how far the virtual rig with what was `said` is from the truth; None where it cannot
    do that."""
    try:
        return relative_error(_maps(case, said, times), clean)
    except InputError:
        return None


def _said_effects(result: Path) -> tuple[EffectDescription, ...]:
    """Return the effects that the diagnosis in `result` kept, with the parameters it gives them."""
    said = json.loads((result / 'diagnosis.json').read_text(encoding='utf-8'))
    rows = {row['name']: row['parameters'] for row in said['effects']}
    return tuple(
        EffectDescription(
            name=name,
            parameters={key: parameter['value'] for key, parameter in rows[name].items()},
        )
        for name in said['combination']
    )


def _maps(case: BlindCase, effects: Sequence[EffectDescription], times: FloatArray) -> FloatArray:
    """Return what a camera without noise would show at `times` [s], (nt, nz, nx)."""
    rig = VirtualRig(case.rig, effects=effects)
    grid = case.rig.default_grid(case.cell_m)
    return np.stack([m for _, m in signals(rig, case.schedule, times=times.tolist(), grid=grid)])


def _strongest(case: BlindCase, clean: FloatArray, times: FloatArray) -> tuple[str, ...]:
    if len(case.effects) < 2:
        return case.right
    nothing = _maps(case, (), times)
    alone = [_maps(case, (effect,), times) for effect in case.effects]
    left = [relative_error(maps, clean) for maps in alone]
    made = [relative_error(maps, nothing) for maps in alone]
    return tuple(
        name
        for effect, error, gap in zip(case.effects, left, made, strict=True)
        if error <= AS_STRONG * min(left) or gap >= max(made) / AS_STRONG
        for name in equal_names(effect)
    )
