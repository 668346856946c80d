"""How much of an effect the calibration on a flawed rig hides from the maps.

A calibration believes that the rig is as described. If tracer fades in the rig, it also faded in
the known injection, and the calibration takes a pale core for stock: part of the effect is gone
from the maps. With the maps c of the virtual rig without effects, e_i with effect i alone, and m
from the photographs, the part that is left of each effect is the least squares solution of

    m - c = sum over i of left_i (e_i - c),    absorbed_i = 1 - left_i.
"""

import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Self

import numpy as np

from lab.blind.blind_cases import BlindCase
from porotwin_core.geometry.grid import FloatArray, relative_error
from porotwin_core.rig import EffectDescription
from porotwin_recording.tables.concentration import open_maps
from porotwin_rig.made_experiment import signals

HIDDEN = 0.7
"""Absorbed part of an effect [-] above which no diagnosis can be asked to find it in the maps."""

LEAST_GAP = 0.02
"""Relative L2 norm of an effect below which the part that is left is mostly an error of maps."""

WITNESSES: Mapping[str, str] = {
    'rate': 'weigh the water of the pump',
    'porosity': 'the mass in the maps against the pump log; weigh the sand',
    'depth': 'the mass in the maps against the pump log; measure the gap of the plates',
    'retardation': 'the mass in the maps against the pump log; a column test',
    'decay': 'photograph an old and a fresh plume of stock; keep a bottle in the light',
    'dual_porosity': 'inject water after the tracer and watch its rest; photograph a dilution',
    'saturation': 'photographs of known dilutions in the sand (role dilution)',
    'illumination': 'clean sand and the colour chart in every photograph',
    'registration': 'a ruler or a grid in front of the sand',
    'clock': 'photograph a clock',
    'leak': 'weigh the outflow',
    'background_flow': 'weigh the outflow while all pumps rest',
}
"""Checks that show an effect without the camera, or without the same injection."""

OTHER_WITNESS = 'an injection into another well'


@dataclass(frozen=True)
class MapFigures:
    """The maps of a case beside the maps that only the virtual rig knows, over all photographs.

    Attributes:
        error: relative L2 error of the maps.
        gaps: relative L2 norm of the change that each true effect makes alone, by name.
        absorbed: part of that change that the maps do not show [-], by name; effects with a gap
            below `LEAST_GAP` are not in it.
    """

    error: float
    gaps: dict[str, float]
    absorbed: dict[str, float]

    @property
    def hidden(self) -> frozenset[str]:
        """Names of the effects that the calibration took out of the maps."""
        return frozenset(name for name, part in self.absorbed.items() if part > HIDDEN)

    def write(self, path: Path) -> None:
        """Write the figures as JSON."""
        path.write_text(json.dumps(asdict(self), indent=1) + '\n', encoding='utf-8')

    @classmethod
    def read(cls, path: Path) -> Self:
        """Return the figures in the file `path`."""
        return cls(**json.loads(path.read_text(encoding='utf-8')))


def map_figures(case: BlindCase, maps_file: Path, clean_file: Path) -> MapFigures:
    """Return the figures of the maps in `maps_file`; `clean_file` holds the maps without noise.

    Raises:
        InputError: a file cannot be read.
    """
    seen, clean = (open_maps(path, case.rig) for path in (maps_file, clean_file))
    rows = np.isin(clean.times, seen.times)
    observed, true = np.array(seen[:], dtype=float), clean[:][rows].astype(float)
    known = np.isfinite(observed)
    error = relative_error(observed[known], true[known])
    if not case.effects:
        return MapFigures(error, {}, {})
    alone = [(), *((effect,) for effect in case.effects)]
    plain, *changed = (_maps(case, effects, clean.times)[rows][known] for effects in alone)
    names = [effect.name for effect in case.effects]
    gaps, absorbed = absorbed_parts(observed[known], plain, dict(zip(names, changed, strict=True)))
    return MapFigures(error, gaps, absorbed)


def absorbed_parts(
    observed: FloatArray, plain: FloatArray, alone: Mapping[str, FloatArray]
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the gap of every effect, and the part of it that `observed` does not show.

    Args:
        observed: values of maps from photographs, (n,).
        plain: the same values of the rig without effects.
        alone: the same values of the rig with each effect alone, by name.
    """
    size = float(np.linalg.norm(plain))
    changes = {name: values - plain for name, values in alone.items()}
    gaps = {name: float(np.linalg.norm(change)) / size for name, change in changes.items()}
    shown = [name for name, gap in gaps.items() if gap >= LEAST_GAP]
    if not shown:
        return gaps, {}
    patterns = np.stack([changes[name] for name in shown], axis=1)
    left, *_ = np.linalg.lstsq(patterns, observed - plain)
    return gaps, {name: 1.0 - float(part) for name, part in zip(shown, left, strict=True)}


def _maps(case: BlindCase, effects: Sequence[EffectDescription], times: FloatArray) -> FloatArray:
    """Return the maps of the virtual rig of `case` with these `effects`, (nt, nz, nx)."""
    grid = case.rig.default_grid(case.cell_m)
    rig = case.virtual_rig(effects)
    run = signals(rig, case.schedule, times=times.tolist(), grid=grid)
    return np.stack([values for _, values in run])


def absorption_table(figures: Iterable[MapFigures]) -> Iterator[str]:
    """Yield a table of effects in Markdown: the part that calibrations absorb."""
    parts: dict[str, list[float]] = defaultdict(list)
    gaps: dict[str, list[float]] = defaultdict(list)
    for found in figures:
        for name, gap in found.gaps.items():
            gaps[name].append(gap)
            parts[name].extend([found.absorbed[name]] if name in found.absorbed else [])
    yield '| effect | cases | gap in the rig | absorbed by the calibration | shown by |'
    yield '| --- | --- | --- | --- | --- |'
    for name in sorted(gaps):
        absorbed = f'{np.median(parts[name]):.0%}' if parts[name] else '-'
        size = f'{np.median(gaps[name]):.0%}'
        yield f'| {name} | {len(gaps[name])} | {size} | {absorbed} | {witness_of(name)} |'


def witness_of(effect: str) -> str:
    """Return the check that shows `effect` without the camera, or without the same injection."""
    return WITNESSES.get(effect, OTHER_WITNESS)
