"""Readings beside the maps, as measured and as the model has them."""

from collections.abc import Sequence
from concurrent.futures import Executor
from typing import NamedTuple

from porotwin_core.model.gauge_reading import GaugeReading
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.sample import Sample
from porotwin_diagnosis.decision.numerics import ACCURATE
from porotwin_diagnosis.model.forward import Forward


class ComparedReading(NamedTuple):
    """A reading, and the model in its place without and with effects, in SI units."""

    reading: GaugeReading
    before: float
    after: float


def compared_readings(
    samples: Sequence[Sample], effects: Sequence[EffectDescription], crew: Executor | None
) -> tuple[ComparedReading, ...]:
    """Return all readings of `samples` beside the model without and with `effects`.

    Raises:
        InputError: the model cannot run with `effects`.
    """
    found: list[ComparedReading] = []
    for sample in samples:
        if not sample.readings:
            continue
        forward = Forward(sample, preset=ACCURATE, crew=crew)
        off = (forward.readings_off(()), forward.readings_off(effects))
        found += [
            ComparedReading(one, *(_shown(one, by[k]) for by in off))
            for k, one in enumerate(sample.readings)
        ]
    return tuple(found)


def _shown(reading: GaugeReading, off: float) -> float:
    return float(reading.value - off * reading.deviation)
