"""Diagnoses and maps of blinded cases that the tests share."""

import json
from pathlib import Path

import numpy as np

from lab.blind.blind_cases import BlindCase, draw_case
from porotwin_core.geometry.grid import FloatArray
from porotwin_diagnosis.decision.held_out import HeldOut
from porotwin_diagnosis.report.held_out_fields import write_fields
from porotwin_recording.tables.concentration import ConcentrationWriter, open_maps
from porotwin_rig.made_experiment import signals


def case_of_kind(kind: str) -> BlindCase:
    """Return the first case of `kind` with seed 1."""
    return next(case for case in (draw_case(n, 1) for n in range(60)) if case.kind == kind)


def clean_maps(path: Path, case: BlindCase, times) -> FloatArray:
    """Write and return the maps of the virtual rig at `times`, without noise, (nt, nz, nx)."""
    grid = case.rig.default_grid(case.cell_m)
    rig = case.virtual_rig(case.effects)
    with ConcentrationWriter(path, grid) as writer:
        for time, signal in signals(rig, case.schedule, times=times, grid=grid):
            writer.append(time, signal)
    return np.asarray(open_maps(path, case.rig)[:], dtype=float)


def stated(
    folder: Path, verdict: str, confidence: float, combination=(), parameters=(), listed=()
) -> Path:
    """Write a diagnosis.json with one verdict into `folder`, and return the folder."""
    folder.mkdir(exist_ok=True)
    values = {key: {'value': value} for key, value in parameters}
    content = {
        'verdict': verdict,
        'not_separable_from': list(listed),
        'confidence': confidence,
        'combination': list(combination),
        'effects': [{'name': name, 'parameters': values} for name in combination],
        'error': {'gap_closed': 0.9, 'before': 0.2, 'noise_floor': 0.05},
        'where': {'centre': None},
        'made_with': {'seconds': 60.0},
    }
    (folder / 'diagnosis.json').write_text(json.dumps(content))
    return folder


def predicted(folder: Path, case: BlindCase, times, observed, before, after) -> None:
    """Write a fields.nc with these held-out maps into `folder`."""
    held_out = HeldOut(np.array(times), observed, before, after, 0.1, 0.0, 0.0, 0.0)
    write_fields(folder / 'fields.nc', case.rig.default_grid(case.cell_m), observed[0], held_out)
