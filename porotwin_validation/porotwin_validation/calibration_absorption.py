"""How much of an effect the calibration on a flawed rig hides from the maps.

A calibration believes that the rig is as described. If tracer fades in the rig, it also faded in
the known injection, and the calibration takes a pale core for stock: part of the effect is gone
from the maps. With the maps c of the virtual rig without the effect, e with it, and m from the
photographs, the part that is left is the projection

    left = <m - c, e - c> / <e - c, e - c>,    absorbed = 1 - left.
"""

import json
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Self

import numpy as np

from porotwin_core.grid import relative_error
from porotwin_recording.concentration import open_maps
from porotwin_rig.made_experiment import signals
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_validation.blind_cases import BlindCase

LEAST_GAP = 0.02
"""Relative L2 norm of an effect below which the part that is left is mostly an error of maps."""

WITNESSES: Mapping[str, str] = {
    'rate': 'weigh what the pump delivers',
    'porosity': 'the mass in the maps against the pump log; weigh the sand',
    'depth': 'the mass in the maps against the pump log; measure the gap of the plates',
    'retardation': 'the mass in the maps against the pump log; a column test',
    'decay': 'photograph an old and a fresh plume of stock; keep a bottle in the light',
    'dual_porosity': 'chase with water and watch the tail; photograph a dilution',
    'saturation': 'photographs of known dilutions in the sand (role dilution)',
    'illumination': 'clean sand and the colour chart in every photograph',
    'registration': 'a ruler or a grid in front of the sand',
    'clock': 'photograph a clock',
    'leak': 'weigh what flows out',
    'background_flow': 'weigh what flows out while all pumps rest',
}
"""What shows an effect without the camera, or without the same injection."""

OTHER_WITNESS = 'an injection into another well'


@dataclass(frozen=True)
class MapFigures:
    """The maps of a case beside the maps that only the virtual rig knows, over all photographs.

    Attributes:
        error: relative L2 error of the maps.
        gap: relative L2 norm of the change that the true effects make.
        absorbed: part of that change that the maps do not show [-]; None without a gap.
    """

    error: float
    gap: float
    absorbed: float | None

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
        return MapFigures(error, 0.0, None)
    run = signals(
        VirtualRig(case.rig),
        case.schedule,
        times=clean.times.tolist(),
        grid=case.rig.default_grid(case.cell_m),
    )
    plain = np.stack([values for (_, values), kept in zip(run, rows, strict=True) if kept])
    change = (true - plain)[known]
    gap = float(np.linalg.norm(change) / np.linalg.norm(plain[known]))
    if gap < LEAST_GAP:
        return MapFigures(error, gap, None)
    left = float(np.sum((observed - plain)[known] * change) / np.sum(change**2))
    return MapFigures(error, gap, 1.0 - left)


def absorption_table(
    cases: Sequence[BlindCase], figures: Mapping[str, MapFigures]
) -> Iterator[str]:
    """Yield a table of single effects in Markdown: the part that calibrations absorb.

    Args:
        cases: the cases.
        figures: the figures of those that have maps, by name of the case.
    """
    by_effect: dict[str, list[MapFigures]] = defaultdict(list)
    for case in cases:
        if case.name in figures and len(case.effects) == 1:
            by_effect[case.effects[0].name].append(figures[case.name])
    yield '| effect | cases | gap in the rig | absorbed by the calibration | shown by |'
    yield '| --- | --- | --- | --- | --- |'
    for name, found in sorted(by_effect.items()):
        parts = [one.absorbed for one in found if one.absorbed is not None]
        absorbed = f'{np.median(parts):.0%}' if parts else '-'
        gap = np.median([one.gap for one in found])
        witness = WITNESSES.get(name, OTHER_WITNESS)
        yield f'| {name} | {len(found)} | {gap:.0%} | {absorbed} | {witness} |'
