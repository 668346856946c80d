"""Flaws of a calibration, as laboratories make them, for composed photographs."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from lab.photographs.dyed_sand import Linear, Obstacle

Array = NDArray[Any]

Expectation = Literal['use', 'refuse', 'either']
"""Whether a calibration must be used, must be refused, or may be either: its maps decide."""


@dataclass(frozen=True)
class Flaw:
    """One thing that is wrong, or nothing.

    Attributes:
        meaning: a few words for tables.
        expected: the right answer of a calibration.
        log_factor: rates of the pump log relative to the true ones [-].
        log_well: the pump log names another well.
        clock_s: stamps of the photographs relative to the true time [s].
        curvature: the description has the terms of curvature.
        baseline_share: tracer in the baseline, as a share of the duration of the injection [-].
        duration_factor: duration of the injection relative to an ordinary one [-].
        concentration: concentration of the injected fluid [-], as the pump log says.
        moved_px: the camera is displaced by this after the baseline [px at 1600 px width].
        absorption_factor: absorption of the dye relative to an ordinary one [-].
        colour: order of the channels of the dye.
        obstacle: name in `OBSTACLES` of a disturbance in one photograph.
        effect: name and range of a true effect of the rig, as in docs/effects.md.
    """

    meaning: str
    expected: Expectation = 'use'
    log_factor: float = 1.0
    log_well: bool = False
    clock_s: float = 0.0
    curvature: bool = True
    baseline_share: float = 0.0
    duration_factor: float = 1.0
    concentration: float = 1.0
    moved_px: float = 0.0
    absorption_factor: float = 1.0
    colour: tuple[int, int, int] = (0, 1, 2)
    obstacle: str = ''
    effect: tuple[str, float, float] | None = None


FLAWS: Mapping[str, Flaw] = {
    'none': Flaw('nothing'),
    'red dye': Flaw('a red dye', colour=(1, 2, 0)),
    'blue dye': Flaw('a blue dye', colour=(0, 2, 1)),
    'weak dye': Flaw('a dye that absorbs a third', absorption_factor=0.35),
    'retardation': Flaw('tracer sorbs', effect=('retardation', 1.04, 1.12)),
    'porosity': Flaw('another porosity', effect=('porosity', 0.92, 1.08)),
    'depth': Flaw('the plates bulge', effect=('depth', 0.9, 1.1)),
    'hand': Flaw('a hand in one photograph', obstacle='hand'),
    'shadow': Flaw('a soft shadow in one photograph', obstacle='shadow'),
    'glare': Flaw('a reflection in one photograph', obstacle='glare'),
    'moved': Flaw('camera moved after the baseline', moved_px=12.0),
    'log x1.3': Flaw('pump log x 1.3', 'either', log_factor=1.3),
    'log /1.3': Flaw('pump log / 1.3', 'either', log_factor=1 / 1.3),
    'no curvature': Flaw('no curvature in rig.yaml', 'either', curvature=False),
    'leaking well': Flaw('the well delivers 70 %', 'either', log_factor=1 / 0.7),
    'late clock': Flaw('stamps 240 s late', 'either', clock_s=240.0),
    'log x3': Flaw('pump log x 3', 'refuse', log_factor=3.0),
    'log /3': Flaw('pump log / 3', 'refuse', log_factor=1 / 3),
    'wrong well': Flaw('pump log of another well', 'either', log_well=True),
    'dyed baseline': Flaw('baseline shows tracer', 'refuse', baseline_share=0.2),
    'too short': Flaw('injection of 60 s', 'refuse', duration_factor=0.025),
    'too pale': Flaw('tracer at 0.3 of stock', 'refuse', concentration=0.3),
    'no absorption': Flaw('a dye that does not absorb', 'refuse', absorption_factor=0.0),
}
"""All flaws by name."""

WITHHELD_KIND = (
    *('none', 'none', 'retardation', 'none', 'no curvature', 'porosity', 'none', 'log x3'),
    *('depth', 'none', 'shadow', 'log /3', 'hand', 'none', 'log x1.3', 'red dye', 'none'),
    *('dyed baseline', 'glare', 'too pale'),
)
"""Flaws of twenty cases in their order: most are made well, the others are wrong in one thing."""


def drawn_obstacle(name: str, generator: np.random.Generator) -> Obstacle:
    """Return the disturbance `name` of `OBSTACLES` at a drawn place."""
    return OBSTACLES[name](generator)


def _hand(generator: np.random.Generator) -> Obstacle:
    """Return an arm that reaches into the picture from its lower edge."""
    across, down = generator.uniform(0.2, 0.8), generator.uniform(0.3, 0.6)
    lean = generator.uniform(-0.2, 0.2)

    def change(light: Linear) -> Linear:
        rows, columns = light.shape[:2]
        mask = np.zeros((rows, columns), np.float32)
        tip = (int(across * columns), int(down * rows))
        elbow = (int((across + lean) * columns), rows + 40)
        cv2.line(mask, tip, elbow, 1.0, max(3, columns // 18))
        cv2.circle(mask, tip, columns // 22, 1.0, -1)
        soft = cv2.GaussianBlur(mask, (0, 0), 2.0)[..., None]
        skin = np.array([0.12, 0.2, 0.38], np.float32)
        return np.asarray(light * (1 - soft) + skin * soft)

    return change


def _shadow(generator: np.random.Generator) -> Obstacle:
    """Return a soft shadow over about a quarter of the picture, 15 to 30 % deep."""
    across, down = generator.uniform(0.1, 0.9), generator.uniform(0.2, 0.8)
    depth, reach = generator.uniform(0.15, 0.3), generator.uniform(0.15, 0.25)
    return lambda light: light * (1 - depth * _spot(light, across, down, reach))


def _glare(generator: np.random.Generator) -> Obstacle:
    """Return a white reflection of a lamp in the glass."""
    across, down = generator.uniform(0.2, 0.8), generator.uniform(0.3, 0.8)
    light_added, reach = generator.uniform(0.3, 0.8), generator.uniform(0.02, 0.05)
    return lambda light: light + light_added * _spot(light, across, down, reach)


def _spot(light: Linear, across: float, down: float, reach: float) -> Linear:
    """Return a Gaussian spot of height 1; `reach` is relative to the width of the picture."""
    rows, columns = light.shape[:2]
    row, column = np.ogrid[:rows, :columns]
    distance = np.hypot(column - across * columns, row - down * rows) / (reach * columns)
    return np.exp(-0.5 * distance**2)[..., None].astype(np.float32)


OBSTACLES: Mapping[str, Callable[[np.random.Generator], Obstacle]] = {
    'hand': _hand,
    'shadow': _shadow,
    'glare': _glare,
}
"""Disturbances of the light of one photograph."""
