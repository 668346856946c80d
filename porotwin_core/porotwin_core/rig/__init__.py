"""The description of a rig: reads, checks and writes `rig.yaml` as immutable records.

`sections`, `sand_sections` and `control_section` hold the parts of the description, `description`
the whole rig. `rig_file` reads and writes files, with the help of `yaml_reader`, `map_file`,
`zone_file`, `sand_drawing` and `depth_points`. `complaints` turns validation errors into one line,
`oddities` looks for odd values. docs/rig.md lists every key.
"""

from porotwin_core.rig.control_section import (
    PUMP_STEP_ML_H,
    Control,
    FixedWell,
    ObjectiveDescription,
)
from porotwin_core.rig.description import Rig
from porotwin_core.rig.rig_file import load_rig, parse_rig, read_rig, rig_from_maps, write_rig
from porotwin_core.rig.sections import (
    DEFAULT_WELL_RADIUS,
    SIDES,
    Boundaries,
    Camera,
    EffectDescription,
    MapReference,
    Polygon,
    SideName,
    WaterBody,
    WaterTable,
    Well,
    ZoneFile,
)

__all__ = [
    'DEFAULT_WELL_RADIUS',
    'PUMP_STEP_ML_H',
    'SIDES',
    'Boundaries',
    'Camera',
    'Control',
    'EffectDescription',
    'FixedWell',
    'MapReference',
    'ObjectiveDescription',
    'Polygon',
    'Rig',
    'SideName',
    'WaterBody',
    'WaterTable',
    'Well',
    'ZoneFile',
    'load_rig',
    'parse_rig',
    'read_rig',
    'rig_from_maps',
    'write_rig',
]
