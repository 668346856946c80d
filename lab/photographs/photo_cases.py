"""Cases of composed photographs: a calibration and a recording with known truth, drawn by seed.

    python -m lab.photographs.photo_cases FOLDER OUTPUT [--cases 20] [--seed 1] [--flaw NAME]

FOLDER is an experiment folder with a baseline photograph of a real rig, and its sands as a map of
permeability. OUTPUT gets two experiment folders per case, `c000` and `c000_cal`: a recording and a
known injection on the same rig with the same camera. The recording also holds `truth.nc`, the
concentration without noise, and `truth.yaml`.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray

from lab.photographs.dyed_sand import Dye, DyedSand, DyeResponse, Obstacle, Shot, sands_of
from lab.photographs.photo_flaws import FLAWS, WITHHELD_KIND, Flaw, drawn_obstacle
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.photo_list import Role
from porotwin_core.basis.units import MOLECULAR_DIFFUSION, from_ml_h
from porotwin_core.geometry.grid import conservative_resample
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import EffectDescription, Rig
from porotwin_recording.experiment.experiment_folder import folder_data, write_folder
from porotwin_recording.tables.concentration import ConcentrationWriter
from porotwin_recording.tables.photos import Photo
from porotwin_recording.tables.recorded_data import RecordedData
from porotwin_solver.effects import EFFECTS
from porotwin_solver.model.simulation import simulate

Array = NDArray[Any]

TRUTH_GRID = (280, 150)
"""Columns and rows of the true maps on a rig of the shape of the large FluidFlower."""
_FINER = 2
"""The tracer is simulated and photographed on a grid finer by this. Interpolation of the true maps
themselves would blur their fronts."""
PHOTOGRAPHS = 7
"""Photographs of an injection for a calibration, beside the baseline."""
RECORDED = 9
"""Photographs of a recording, beside the baseline."""
_LOG10_PERMEABILITY = (-10.4, -9.35, -8.95, -8.7)
_RED = (1.12, 1.20, 1.65, 1.95)
_GREEN_SHARE = (0.64, 0.59, 0.64, 0.675)
_BLUE_SHARE = (1.28, 1.20, 1.10, 0.97)
"""Absorption of red by stock, and of green and blue relative to red, by log10 permeability [m^2]:
fits to the real tracer photographs of the large FluidFlower."""
_SAND_SPREAD, _SAND_TILT = 0.015, 0.08
"""Standard deviation of the absorption of a sand [log], by itself and along the permeability: sands
that look alike absorb alike."""
_LARGE_PORES = 0.046
"""Pore volume of the large FluidFlower [m^3]."""
_SHAKE_PX, _ROTATION_DEG, _WIDTH_PX = 1.0, 0.012, 1600
"""Standard deviations of shift and rotation of a photograph, and the width they refer to [px]."""
_SCHEMES = ('fast', 'accurate')
"""Presets of the solver that make the truth: their numerical dispersion differs."""
_DISPERSED = 0.6
"""Share of the cases whose sand disperses tracer [-]."""
_DISPERSIVITY_M, _TRANSVERSE = (1e-4, 3e-3), (0.05, 0.3)
"""Ranges of the dispersivity along the flow [m], and of that across it relative to it [-]."""
_DRIFT, _SLOPE, _WARMTH = 0.02, 0.006, 0.002
"""Amplitudes of the drift of the lamps, of its slopes and of its colour [-]."""


@dataclass(frozen=True)
class Take:
    """An experiment that is photographed.

    Attributes:
        schedule: the true rates.
        times: true times of the photographs [s], the baseline first.
        shots: pose and light of each photograph.
        obstacles: disturbance of each photograph, or None.
        baseline_time: true time of the tracer that the baseline shows [s].
    """

    schedule: Schedule
    times: tuple[float, ...]
    shots: tuple[Shot, ...]
    obstacles: tuple[Obstacle | None, ...]
    baseline_time: float = 0.0


@dataclass(frozen=True)
class PhotoCase:
    """A case and its truth.

    Attributes:
        name: name of the case and of its folder.
        flaw: name of its flaw in `FLAWS`.
        rig: the true rig.
        effects: true effects of the rig.
        preset: preset of the solver that makes the truth.
        dye: the dye.
        calibration: the known injection.
        recording: the experiment to be imaged.
        seed: seed of the noise.
    """

    name: str
    flaw: str
    rig: Rig
    effects: tuple[EffectDescription, ...]
    preset: str
    dye: Dye
    calibration: Take
    recording: Take
    seed: int


def draw_case(rig: Rig, number: int, seed: int, flaw: str | None = None) -> PhotoCase:
    """Return case `number` of `seed` on `rig`; by default its flaw is that of `WITHHELD_KIND`.

    Raises:
        InputError: the flaw is not known, or the rig has no well.
    """
    chosen = flaw or WITHHELD_KIND[number % len(WITHHELD_KIND)]
    if chosen not in FLAWS:
        raise InputError(f"flaw '{chosen}' is not known; choose {', '.join(FLAWS)}")
    if not rig.wells:
        raise InputError(f"rig '{rig.name}' has no well; add wells to rig.yaml")
    generator = np.random.default_rng([seed, number])
    wrong = FLAWS[chosen]
    dye = drawn_dye(rig, generator, wrong)
    calibration = _injection(rig, generator, wrong)
    recording = _experiment(rig, generator)
    return PhotoCase(
        f'c{number:03d}',
        chosen,
        rig,
        (*_effects(wrong, generator), *_dispersion(generator)),
        str(generator.choice(_SCHEMES)),
        dye,
        calibration,
        recording,
        seed=1000 * seed + number,
    )


def drawn_dye(rig: Rig, generator: np.random.Generator, flaw: Flaw = FLAWS['none']) -> Dye:
    """Return a dye near the one of the large FluidFlower, for the sands of `rig`."""
    levels = np.unique(np.log10(np.atleast_2d(rig.nominal_map('permeability_m2'))).round(3))
    red, green, blue = (
        np.interp(levels, _LOG10_PERMEABILITY, values)
        for values in (_RED, _GREEN_SHARE, _BLUE_SHARE)
    )
    strength = generator.uniform(0.8, 1.2) * flaw.absorption_factor
    absorption = np.stack([red, red * green, red * blue], axis=1)
    tilt = _SAND_TILT * generator.standard_normal() * np.linspace(-1, 1, len(levels))
    alone = _SAND_SPREAD * generator.standard_normal(len(levels))
    absorption *= strength * np.exp(tilt + alone)[:, None]
    families = {
        'exponential': generator.uniform(-0.3, 1.0),
        'saturating': generator.uniform(-0.2, 0.8),
        'power': generator.uniform(0.88, 1.12),
    }
    family = str(generator.choice(list(families), p=[0.6, 0.25, 0.15]))
    grain = np.array([0.67, 0.36, 0.63]) * generator.uniform(0.6, 1.1) * strength
    order = list(flaw.colour)
    return Dye(
        np.vstack([np.zeros(3), absorption[:, order]]),
        tuple(float(value) for value in grain[order]),  # type: ignore[arg-type]
        DyeResponse(family, float(families[family])),  # type: ignore[arg-type]
    )


def write_case(case: PhotoCase, baseline: NDArray[np.uint8], output: Path) -> Path:
    """Write recording and calibration of `case` below `output`; return the recording's folder.

    Args:
        case: the case.
        baseline: pixels of the real baseline, uint8, shape (rows, columns, 3 = blue, green, red).
        output: folder for both experiment folders.

    Raises:
        InputError: a folder is in use.
    """
    flaw = FLAWS[case.flaw]
    told = case.rig
    if not flaw.curvature and told.camera is not None:
        told = told.model_copy(update={'camera': told.camera.model_copy(update={'curvature': {}})})
    scene = DyedSand(case.rig, baseline, sands_of(case.rig, baseline), case.dye)
    recording, calibration = output / case.name, output / f'{case.name}_cal'
    maps = _maps(case, case.recording)
    photos = _photos(scene, case.recording, maps, (case.seed, 0), clock=0.0)
    write_folder(recording, RecordedData(told, commanded=case.recording.schedule, photos=photos))
    with ConcentrationWriter(recording / 'truth.nc', case.rig.grid(*TRUTH_GRID)) as truth:
        for time, values in zip(case.recording.times, maps, strict=True):
            truth.append(time, conservative_resample(values, TRUTH_GRID[::-1]))
    (recording / 'truth.yaml').write_text(yaml.safe_dump(_truth(case), sort_keys=False))
    injected = _maps(case, case.calibration)
    photos = _photos(scene, case.calibration, injected, (case.seed, 1), clock=flaw.clock_s)
    commanded = _told(case.calibration.schedule, flaw, tuple(case.rig.wells))
    write_folder(calibration, RecordedData(told, commanded=commanded, photos=photos))
    return recording


def baseline_of(folder: Path) -> tuple[Rig, NDArray[np.uint8]]:
    """Return the rig and the baseline photograph of the experiment in `folder`.

    Raises:
        InputError: the folder has no readable baseline photograph.
    """
    data = folder_data(folder)
    found = [photo for photo in data.photos if photo.role == 'baseline']
    if not found:
        raise InputError(f'{folder}: no baseline photograph; give one that role in imaging.csv')
    pixels = cv2.imdecode(np.frombuffer(found[0].read(), np.uint8), cv2.IMREAD_COLOR)
    if pixels is None:
        raise InputError(f'{folder}: {found[0].name} is no photograph')
    return data.rig, np.asarray(pixels, np.uint8)


def _maps(case: PhotoCase, take: Take) -> Array:
    """Return the concentration at the times of the photographs on the fine grid, (n, nz, nx)."""
    shown = (take.baseline_time, *take.times[1:])
    order = np.argsort(shown, kind='stable')
    maps = simulate(
        case.rig,
        take.schedule,
        np.array(shown)[order],
        grid=case.rig.grid(*TRUTH_GRID).refined(_FINER),
        preset=case.preset,
        effects=case.effects,
    )
    return np.clip(maps[np.argsort(order, kind='stable')], 0.0, 1.0)


def _photos(
    scene: DyedSand, take: Take, maps: Array, seed: tuple[int, int], *, clock: float
) -> tuple[Photo, ...]:
    """Return the photographs of an experiment; states are stamped `clock` [s] late."""
    photos = []
    for number, (time, values, shot, obstacle) in enumerate(
        zip(take.times, maps, take.shots, take.obstacles, strict=True)
    ):
        data = scene.photograph(values, shot, seed=(*seed, number), obstacle=obstacle)
        role: Role = 'state' if number else 'baseline'
        stamp = time + clock if number else time
        photos.append(Photo(stamp, role, f'photos/photo_{number:03d}.jpg', lambda data=data: data))  # type: ignore[misc]
    return tuple(photos)


def _injection(rig: Rig, generator: np.random.Generator, flaw: Flaw) -> Take:
    """Return an injection of tracer at a constant rate into one well."""
    well = str(generator.choice(list(rig.wells)))
    rate = _drawn_rate(rig, generator, 1400, 2400)
    duration = round(float(generator.uniform(1800, 3000)), -1) * flaw.duration_factor
    schedule = Schedule(
        (
            ScheduleRow(0.0, well, WellRate(rate, flaw.concentration)),
            ScheduleRow(duration, well, WellRate()),
        )
    )
    times = np.linspace(duration / PHOTOGRAPHS, duration, PHOTOGRAPHS).round()
    take = _taken(schedule, times, generator, flaw.moved_px)
    obstacles = list(take.obstacles)
    if flaw.obstacle:
        obstacles[int(generator.integers(2, PHOTOGRAPHS + 1))] = drawn_obstacle(
            flaw.obstacle, generator
        )
    return replace(take, obstacles=tuple(obstacles), baseline_time=flaw.baseline_share * duration)


def _experiment(rig: Rig, generator: np.random.Generator) -> Take:
    """Return an experiment with tracer, pauses, and water behind the tracer."""
    wells = generator.permutation(list(rig.wells))[:2]
    rows, time = [], 0.0
    for concentration in (1.0, 0.0):
        for well in wells:
            rate = _drawn_rate(rig, generator, 1500, 2300)
            duration = round(float(generator.uniform(1200, 2100)), -1)
            rows.append(ScheduleRow(time, str(well), WellRate(rate, concentration)))
            rows.append(ScheduleRow(time + duration, str(well), WellRate()))
            time += duration + round(float(generator.uniform(300, 900)), -1)
    times = np.linspace(time / RECORDED, time, RECORDED).round()
    return _taken(Schedule(tuple(rows)), times, generator)


def _drawn_rate(rig: Rig, generator: np.random.Generator, low: float, high: float) -> float:
    """Return a rate [m^3/s], drawn from `low` to `high` [ml/h] for the large FluidFlower.

    Other rigs get rates in proportion to their pores.
    """
    rate_ml_h = float(generator.uniform(low, high)) * rig.pore_volume / _LARGE_PORES
    return from_ml_h(float(f'{rate_ml_h:.3g}'))


def _taken(
    schedule: Schedule, times: Array, generator: np.random.Generator, moved_px: float = 0.0
) -> Take:
    """Return the experiment with a shaking camera and drifting lamps."""
    shots = [Shot(), *drawn_shots(len(times), generator, moved_px)]
    moments = (0.0, *(float(time) for time in times))
    return Take(schedule, moments, tuple(shots), (None,) * len(shots))


def drawn_shots(
    count: int, generator: np.random.Generator, moved_px: float = 0.0
) -> Iterator[Shot]:
    """Yield the shots after the baseline; `moved_px` displaces all of them."""
    angle = generator.uniform(0, 2 * np.pi)
    moved = moved_px * np.array([np.cos(angle), np.sin(angle)])
    phases = generator.uniform(0, 2 * np.pi, (4, 2))
    amplitudes = np.array([_DRIFT, _SLOPE, _SLOPE, _WARMTH]) * generator.uniform(0.3, 1.0, 4)
    for progress in np.linspace(0.0, 1.0, count + 1)[1:]:
        waves = np.sin(2 * np.pi * progress * np.array([0.7, 1.6]) + phases) - np.sin(phases)
        gain, across, down, warmth = (float(v) for v in amplitudes * waves.mean(axis=1))
        shift = moved + _SHAKE_PX * generator.standard_normal(2)
        rotation = _ROTATION_DEG * generator.standard_normal() + 0.01 * moved_px
        yield Shot(
            (float(shift[0]), float(shift[1])), float(rotation), 1 + gain, (across, down), warmth
        )


def _effects(flaw: Flaw, generator: np.random.Generator) -> tuple[EffectDescription, ...]:
    """Return the true effect of the rig, with a value drawn from its range."""
    if flaw.effect is None:
        return ()
    name, low, high = flaw.effect
    (parameter,) = EFFECTS[name].parameters
    value = float(generator.uniform(low, high))
    return (EffectDescription(name=name, parameters={parameter: value}),)


def _dispersion(generator: np.random.Generator) -> tuple[EffectDescription, ...]:
    """Return the dispersion of the sand; many rigs have hardly any."""
    dispersed, low, high = generator.random() < _DISPERSED, *np.log(_DISPERSIVITY_M)
    along = float(np.exp(generator.uniform(low, high)))
    across = along * float(generator.uniform(*_TRANSVERSE))
    if not dispersed:
        return ()
    parameters = {
        'longitudinal_dispersivity': along,
        'transverse_dispersivity': across,
        'diffusion': MOLECULAR_DIFFUSION,
    }
    return (EffectDescription(name='dispersion', parameters=parameters),)


def _told(schedule: Schedule, flaw: Flaw, wells: Sequence[str]) -> Schedule:
    """Return the pump log that the laboratory believes in."""
    rows = []
    for row in schedule.rows:
        well = next((name for name in wells if name != row.well), row.well)
        rate = WellRate(row.rate.rate * flaw.log_factor, row.rate.concentration)
        rows.append(ScheduleRow(row.time, well if flaw.log_well else row.well, rate))
    return Schedule(tuple(rows))


def _truth(case: PhotoCase) -> dict[str, Any]:
    """Return the content of truth.yaml."""
    flaw = FLAWS[case.flaw]
    response = case.dye.response
    return {
        'name': case.name,
        'flaw': case.flaw,
        'expected': flaw.expected,
        'effects': [effect.model_dump() for effect in case.effects],
        'preset': case.preset,
        'response': {'family': response.family, 'bend': round(response.bend, 4)},
        'absorption': case.dye.absorption.round(4).tolist(),
        'grain': [round(value, 4) for value in case.dye.grain],
        'seed': case.seed,
    }


def main() -> None:
    """Write the cases that the command line asks for."""
    parser = argparse.ArgumentParser(description='Compose photographs with known truth.')
    parser.add_argument('folder', type=Path, help='experiment folder with a real baseline')
    parser.add_argument('output', type=Path, help='folder for the cases')
    parser.add_argument('--cases', type=int, default=len(WITHHELD_KIND))
    parser.add_argument('--first', type=int, default=0, help='number of the first case')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--flaw', choices=list(FLAWS), help='the same flaw in all cases')
    asked = parser.parse_args()
    rig, baseline = baseline_of(asked.folder)
    for number in range(asked.first, asked.first + asked.cases):
        case = draw_case(rig, number, asked.seed, asked.flaw)
        print(write_case(case, baseline, asked.output), case.flaw)


if __name__ == '__main__':
    main()
