"""The installed extension: its effect acts in the solver, its pump obeys, its command is there."""

from pathlib import Path

import numpy as np
from typer.testing import CliRunner

import porotwin
from porotwin_cli.app import app
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_core.rig import parse_rig
from porotwin_pumps.protocols.protocol_registry import PROTOCOLS

RIG = parse_rig(
    {
        'name': 'box',
        'width_m': 0.4,
        'height_m': 0.2,
        'depth_m': 0.01,
        'porosity': 0.4,
        'permeability_m2': 1e-9,
        'viscosity_pa_s': 1e-3,
        'density_kg_m3': 998.0,
        'wells': {'in': {'x_m': 0.1, 'z_m': 0.1}, 'out': {'x_m': 0.35, 'z_m': 0.1}},
    },
    Path('rig.yaml'),
)


def test_the_wedge_widens_the_plume_where_the_gap_is_narrow() -> None:
    rate = from_ml_h(100.0)
    rates = Schedule.constant({'in': WellRate(rate, 1.0), 'out': WellRate(-rate, 0.0)})
    area = [
        (porotwin.simulate(RIG, rates, [600.0], grid=RIG.grid(40, 20), effects=effects) > 0.5).sum()
        for effects in ([], [porotwin.parse_effect('wedge:slope=2.0')])
    ]
    assert area[1] > 1.2 * area[0]
    assert porotwin.EFFECTS['wedge'].phrase({'slope': 0.01}).endswith('10% per 10 cm')


class Line:
    """Plays the pump."""

    rate = 0.0

    def ask(self, question: bytes, *, end: bytes) -> bytes:
        word = question.decode().strip()
        if word[1:] != '?':
            self.rate = float(word[1:])
        return f'{self.rate if word[0] == "R" else 1.5}'.encode() + end


def test_the_pump_obeys() -> None:
    line = Line()
    pump = PROTOCOLS['bench_pump'].open(line, 0)
    pump.set_rate(-250.0)
    assert line.rate == -250.0
    assert np.isclose(pump.volume_ml(), 1.5)


def test_the_command_is_among_the_others() -> None:
    shown = CliRunner().invoke(app, ['plume-area', '--help'])
    assert 'area of the plume' in shown.output
    assert 'wedge' in CliRunner().invoke(app, ['simulate', '--help']).output
