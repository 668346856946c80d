"""How often a posterior holds a hidden rate, on relative maps of the virtual rig.

    .venv/bin/python -m lab.photographs.hidden_rates --draws 12
    .venv/bin/python -m lab.photographs.hidden_rates --draws 6 --thin

Two sources inject into a uniform flow. Their rates are drawn from the prior of `rig.yaml`, and the
maps are divided by their core.
"""

import argparse
import math
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import Rig
from porotwin_core.rig.rig_file import parse_rig
from porotwin_diagnosis.model.unknown_rates import SourceRate, settled
from porotwin_recording.experiment.recording import Recording, open_recording
from porotwin_recording.tables.concentration import MapOrigin, Maps
from porotwin_rig.made_experiment import make_experiment
from porotwin_rig.map_camera import MapNoise
from porotwin_rig.virtual_rig import VirtualRig

PRIOR_ML_H = [40.0, 250.0]
GUESS_ML_H = 100.0
SPREADING = {'longitudinal_dispersivity': 0.002, 'transverse_dispersivity': 0.0003}
"""Known to the model as well [m]."""
THIN = [15.0, 120.0], {'longitudinal_dispersivity': 0.003, 'transverse_dispersivity': 0.0006}
"""Prior and spreading of plumes that are thinner than their mixing."""
CORE_SHARE, CORE_LEAST = 0.95, 0.3
"""The core is this quantile of all values above the least one [-]."""


def tank(prior: list[float], spreading: dict[str, float]) -> Rig:
    """Return a tank with two sources between two levels."""
    return parse_rig(
        {
            'name': 'tank',
            'width_m': 0.4,
            'height_m': 0.25,
            'depth_m': 0.01,
            'porosity': 0.38,
            'hydraulic_conductivity_m_s': 2e-3,
            'viscosity_pa_s': 1e-3,
            'density_kg_m3': 998.0,
            'boundaries': {
                'top': 'closed',
                'left': 'open',
                'right': 'open',
                'heads_m': {'left': 0.26, 'right': 0.25},
            },
            'wells': {
                'A': {'x_m': 0.10, 'z_m': 0.17, 'rate_prior_ml_h': prior},
                'B': {'x_m': 0.08, 'z_m': 0.08, 'rate_prior_ml_h': prior},
            },
            'effects': [{'name': 'dispersion', 'parameters': spreading}],
        },
        Path('rig.yaml'),
    )


COLUMNS, ROWS, ELEMENT_M = 64, 40, 0.003
"""Cells of the maps, and elements of the virtual rig."""


def hidden(rig: Rig, seed: int, folder: Path) -> tuple[Recording, dict[str, float]]:
    """Return a recording with relative maps and guessed rates, and its true rates [ml/h]."""
    random = np.random.default_rng(seed)
    truth = {}
    for name, well in rig.wells.items():
        assert well.believed_rate_ml_h is not None
        median, deviation = well.believed_rate_ml_h
        truth[name] = float(median * np.exp(deviation * random.standard_normal()))
    make_experiment(
        folder,
        VirtualRig(
            rig.model_copy(update={'effects': ()}), effects=rig.effects, cell=ELEMENT_M
        ),  # the virtual rig has effects of its own
        commanded=_constant(truth),
        duration=1800.0,
        photo_interval=150.0,
        seed=seed,
        noise=MapNoise.drawn(seed),
        grid=rig.grid(COLUMNS, ROWS),
    )
    recording = open_recording(folder, rig=rig)
    values = recording.concentration
    core = float(np.quantile(values[values > CORE_LEAST], CORE_SHARE))
    relative = np.clip(values / core, 0.0, 1.0)

    def read(start: int, stop: int) -> Maps:
        return relative[start:stop]

    origin = MapOrigin(calibrated=False, scale='relative')
    maps = replace(recording.present_maps, read=read, origin=origin)
    guessed = _constant(dict.fromkeys(truth, GUESS_ML_H))
    return replace(recording, maps=maps, commanded=guessed), truth


def _constant(rates_ml_h: dict[str, float]) -> Schedule:
    rows = (
        ScheduleRow(0.0, well, WellRate(from_ml_h(rate), 1.0)) for well, rate in rates_ml_h.items()
    )
    return Schedule(tuple(rows))


def posterior(recording: Recording) -> list[SourceRate]:
    """Return the rates of a recording, without effects beside them."""
    rates = settled([recording]).sources
    return rates.beside(rates.fitter.evaluate((), np.zeros(0)))[1]


def main() -> None:
    """Print every draw, and how many intervals hold the truth."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--draws', type=int, default=20)
    parser.add_argument('--first', type=int, default=11)
    parser.add_argument('--thin', action='store_true')
    asked = parser.parse_args()
    rig = tank(*THIN) if asked.thin else tank(PRIOR_ML_H, SPREADING)
    held = []
    for seed in range(asked.first, asked.first + asked.draws):
        with tempfile.TemporaryDirectory() as folder:
            recording, truth = hidden(rig, seed, Path(folder) / 'run')
            for rate in posterior(recording):
                low, high = rate.interval_ml_h
                held.append(low <= truth[rate.well] <= high)
                off = math.log(rate.rate_ml_h / truth[rate.well])
                print(f'{seed}: {truth[rate.well]:.3g} ml/h; {rate}; off by {100 * off:.0f} %')
    print(f'{sum(held)} of {len(held)} intervals hold the true rate')


if __name__ == '__main__':
    main()
