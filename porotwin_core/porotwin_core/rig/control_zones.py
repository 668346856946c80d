"""The zones that the objective of a rig names: to keep out of, to keep in, or to aim at."""

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import numpy as np

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.geometry.zone_shapes import PolygonZone, Zone
from porotwin_core.rig import Rig

ZoneKind = Literal['keep out', 'keep in', 'target']

_KEYS: dict[str, tuple[str, ZoneKind]] = {
    'keep_out': ('zones_m', 'keep out'),
    'keep_in': ('zone_m', 'keep in'),
    'sweep': ('zones_m', 'target'),
    'reach': ('zone_m', 'target'),
    'hold_front': ('tracer_m', 'target'),
}
"""Key in rig.yaml and purpose of the zone, for each objective with a zone."""


class ControlZone(NamedTuple):
    """A zone and its purpose."""

    kind: ZoneKind
    zone: Zone


def control_zones(rig: Rig) -> list[ControlZone]:
    """Return the zones of the control section and of all parts of its objective.

    A part without corners of its own takes the zone of the file in `control.zone`.
    """
    if rig.control is None:
        return []
    found = _zones('keep out', [rig.control.disallowed_zone_m])
    objective = rig.control.objective
    for name, parameters in _parts(objective.name, objective.parameters):
        own = _zones('keep out', [parameters.get('disallowed_zone_m')])
        if name in _KEYS:
            key, kind = _KEYS[name]
            given = parameters.get(key) or []
            own += _zones(kind, given if key == 'zones_m' else [given])
            if not own and rig.zone is not None:
                own = [ControlZone(kind, rig.zone)]
        found += own
    return found


def unwanted_tracer(rig: Rig, points: FloatArray) -> FloatArray | None:
    """Return a function that marks the points (n, 2) [m] where no tracer must be.

    These points lie in a zone to keep out of, or outside a zone to keep in. The result is None if
    the objective has no such zone."""
    zones = [zone for zone in control_zones(rig) if zone.kind != 'target']
    if not zones:
        return None
    found = np.zeros(len(points), dtype=bool)
    for kind, zone in zones:
        within = zone.contains(points)
        found |= within if kind == 'keep out' else ~within
    return found


def _parts(name: str, parameters: Mapping[str, Any]) -> list[tuple[str, Mapping[str, Any]]]:
    """Return name and parameters of an objective, or of every part of a sum."""
    if name != 'sum':
        return [(name, parameters)]
    parts = [part for part in parameters.get('parts') or [] if isinstance(part, Mapping)]
    return [one for part in parts for one in _parts(str(part.get('name')), part)]


def _zones(kind: ZoneKind, given: Any) -> list[ControlZone]:
    return [
        ControlZone(kind, PolygonZone(np.array(corners, dtype=float)))
        for corners in given
        if corners
    ]
