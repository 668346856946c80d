"""Plausible ranges of physical quantities, and remarks about values outside these ranges.

A value outside `possible` cannot describe a laboratory rig with sand and water, and is refused. A
value outside `usual` is odd: it is used, with a remark. The remark asks for another unit if the
number would be usual with that unit.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

from porotwin_core.basis.remark import NAMED, Remark
from porotwin_core.basis.units import DARCY, GRAVITY, MINUTE_S, ML_H

CONVERTED = (0.7, 1.3)
"""Ratio of two numbers, one of them converted, that shows a mistaken unit [-]."""

CORRECT = 'correct the number'
"""Remedy for a value that no other unit explains."""

Interval = tuple[float, float]
"""The lowest and the highest value of a range."""


@dataclass(frozen=True)
class PlausibleRange:
    """The range of one quantity in the unit of its key in `rig.yaml`.

    unit: the unit, for messages.
    possible, usual: see the module.
    known: the usual things in words, such as "sand lies".
    other_units: factors from other units that people use, by name.
    source: where the numbers come from.
    below: remedy for a value below the usual ones that no other unit explains.
    """

    unit: str
    possible: Interval
    usual: Interval
    known: str
    other_units: tuple[tuple[str, float], ...]
    source: str
    below: str = CORRECT

    def remark(self, key: str, value: float) -> Remark | None:
        """Return the remark about `value` under `key`, or None for a usual value."""
        low, high = self.usual
        if low <= value <= high:
            return None
        unit = f' {self.unit}' if self.unit else ''
        return Remark(
            key=key,
            value=f'{value:g}{unit}',
            why=f'{self.known} between {low:g} and {high:g}{unit}',
            remedy=self._guess(value),
            refused=not self.possible[0] <= value <= self.possible[1],
        )

    def remarks(self, key: str, *values: float) -> Iterator[Remark]:
        """Yield the remark about the first of `values` outside the usual ones."""
        found = (self.remark(key, value) for value in values)
        yield from itertools.islice(filter(None, found), 1)

    def _guess(self, value: float) -> str:
        low, high = self.usual
        unit = f' {self.unit}' if self.unit else ''
        fitting = [
            (name, f'{value:g} {name} = {value * factor:.3g}{unit}')
            for name, factor in self.other_units
            if low <= value * factor <= high
        ][:NAMED]
        if not fitting:
            return self.below if value < low else CORRECT
        names, equations = zip(*fitting, strict=True)
        return f'was this in {" or ".join(names)}? {", ".join(equations)}'


WATER_WEIGHT = 998.0 * GRAVITY / 1.0e-3
"""Hydraulic conductivity over permeability for water at 20 degrees C [1/(m s)]."""

LENGTHS = (('mm', 1e-3), ('cm', 1e-2), ('inches', 0.0254), ('feet', 0.3048))
"""Other units of lengths."""

WIDTH = PlausibleRange(
    unit='m',
    possible=(0.01, 20.0),
    usual=(0.05, 5.0),
    known='tanks behind one pane lie',
    other_units=LENGTHS,
    source='the FluidFlower rigs are 0.9 m and 2.8 m wide; the largest laboratory tanks 20 m',
)
DEPTH = PlausibleRange(
    unit='m',
    possible=(1e-4, 0.5),
    usual=(1e-3, 0.1),
    known='the distance between the plates lies',
    other_units=LENGTHS,
    source='FluidFlower: 10 mm to 28 mm; a few grains at least; flat against the height',
)
POROSITY = PlausibleRange(
    unit='',
    possible=(0.02, 1.0),
    usual=(0.2, 0.6),
    known='sand lies',
    other_units=(('percent', 1e-2),),
    source='Freeze and Cherry, Groundwater (1979), table 2.4: sand 0.25 to 0.50; densest equal '
    'spheres 0.26, mixed grains less',
)
PERMEABILITY = PlausibleRange(
    unit='m2',
    possible=(1e-16, 1e-6),
    usual=(1e-13, 1e-8),
    known='sand lies',
    other_units=(
        ('darcy', DARCY),
        ('millidarcy', 1e-3 * DARCY),
        ('m/s (a hydraulic conductivity)', 1.0 / WATER_WEIGHT),
        ('cm2', 1e-4),
        ('mm2', 1e-6),
        ('um2', 1e-12),
    ),
    below='correct the number, unless it is clay',
    source='Freeze and Cherry, Groundwater (1979), table 2.2: silty sand from 1e-14 m2, gravel to '
    '1e-7 m2; the sands of the FluidFlower benchmark 4e-11 m2 to 1e-8 m2',
)
CONDUCTIVITY = PlausibleRange(
    unit='m/s',
    possible=(1e-9, 10.0),
    usual=(1e-6, 0.1),
    known='sand lies',
    other_units=(
        ('m/day', 1.0 / 86400.0),
        ('cm/s', 1e-2),
        ('mm/s', 1e-3),
        ('cm/h', 1e-2 / 3600.0),
        ('m2 (a permeability)', WATER_WEIGHT),
    ),
    source='as for the permeability, times the weight of water over its viscosity',
)
VISCOSITY = PlausibleRange(
    unit='Pa s',
    possible=(1e-4, 0.1),
    usual=(2.8e-4, 2.0e-3),
    known='water lies',
    other_units=(
        ('mPa s', 1e-3),
        ('m2/s (a kinematic viscosity)', 1e3),
        ('Poise', 0.1),
        ('uPa s', 1e-6),
    ),
    source='IAPWS: 1.79e-3 Pa s at 0 degrees C, 1.00e-3 at 20, 0.28e-3 at 100',
)
DENSITY = PlausibleRange(
    unit='kg/m3',
    possible=(500.0, 2000.0),
    usual=(900.0, 1250.0),
    known='water and brine lie',
    other_units=(('g/cm3', 1e3), ('g/l', 1.0), ('mg/cm3', 1.0)),
    source='IAPWS: 958 kg/m3 to 1000 kg/m3 from 100 to 4 degrees C; saturated brine 1200 kg/m3',
)
WELL_RADIUS = PlausibleRange(
    unit='m',
    possible=(1e-4, 0.1),
    usual=(5e-4, 0.02),
    known='tubes through the back plate lie',
    other_units=LENGTHS,
    source='tubes of laboratory pumps: inner diameters of 1 mm to 25 mm',
)

MOST_PORE_VOLUMES_PER_HOUR = 100.0
"""Rate that no rig stands [pore volumes/h]: the water would pass in 36 s, and lift the sand."""

USUAL_PORE_VOLUMES_PER_HOUR = 10.0
"""Rate above which a rate is odd [pore volumes/h]: a plume would leave within two photographs."""

LEAST_RATE_ML_H = 1e-3
"""Lowest rate that is plausible at all [ml/h]: syringe pumps begin here."""


def plausible_rate_ml_h(pore_volume_m3: float) -> Interval:
    """Return the lowest and highest plausible rate of a well that pumps [ml/h].

    Args:
        pore_volume_m3: the volume of water in the rig [m^3], see `Rig.pore_volume`.
    """
    return LEAST_RATE_ML_H, MOST_PORE_VOLUMES_PER_HOUR * pore_volume_m3 * 1e6


def rate_remark(key: str, rate_ml_h: float, pore_volume_m3: float) -> Remark | None:
    """Return the remark about a rate [ml/h], positive or negative, or None for a usual one."""
    low, high = plausible_rate_ml_h(pore_volume_m3)
    usual = high * USUAL_PORE_VOLUMES_PER_HOUR / MOST_PORE_VOLUMES_PER_HOUR
    size = abs(rate_ml_h)
    if size == 0.0 or low <= size <= usual:
        return None
    pores = f'the pores of the whole rig hold {pore_volume_m3 * 1e6:.3g} ml'
    if size > usual:
        per_second = 'was this in ml/s or another unit? the keys are in ml/h'
        return Remark(key, f'{rate_ml_h:g} ml/h', pores, per_second, refused=size > high)
    in_si = size / ML_H
    remedy = f'was this in m3/s? {size:g} m3/s = {in_si:.4g} ml/h' if low <= in_si <= high else ''
    return Remark(
        key,
        f'{rate_ml_h:g} ml/h',
        f'no pump delivers less than {low:g} ml/h',
        remedy or 'write 0 for a well that rests',
    )


def extent_remark(key: str, last_min: float, end_min: float, unit: str) -> Remark | None:
    """Return a remark if changes until `last_min` do not suit an experiment of `end_min`.

    They reach far beyond it, or would suit it if they were in minutes in place of seconds. `unit`
    is the one to write.
    """
    low, high = (share * end_min for share in CONVERTED)
    if last_min <= high and not low < last_min * MINUTE_S < high:
        return None
    why = f'its last change is at {last_min:.4g} min, and the experiment ends at {end_min:g} min'
    return Remark(key, '', why, f'were its times in another unit? Write {unit}', code='extent')
