"""All keys of `rig.yaml` with their meaning, for messages and for the schema."""

from typing import Any

from porotwin_core.rig.control_section import Control, FixedWell
from porotwin_core.rig.description import Rig
from porotwin_core.rig.sand_sections import (
    DepthPoints,
    DepthPointsFile,
    Sand,
    SandImage,
    SandLayer,
    SandPolygon,
)
from porotwin_core.rig.sections import (
    Boundaries,
    Camera,
    EffectDescription,
    MapReference,
    Section,
    WaterBody,
    WaterTable,
    Well,
)

SECTIONS: tuple[type[Section], ...] = (
    Rig,
    Boundaries,
    Well,
    Camera,
    Control,
    FixedWell,
    EffectDescription,
    Sand,
    SandLayer,
    SandPolygon,
    SandImage,
    DepthPoints,
    DepthPointsFile,
    MapReference,
    WaterBody,
    WaterTable,
)
"""Every section of the description."""

KNOWN_KEYS = {
    name: field.description or ''
    for section in reversed(SECTIONS)
    for name, field in section.model_fields.items()
} | {'zone_m': 'corners (x, z) of the zone [m]'}
"""Meaning of every key by its name; the rig's own keys come last and win."""


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of `rig.yaml`, so that editors complete and check it."""
    schema = Rig.model_json_schema(mode='validation')
    return {
        '$schema': 'https://json-schema.org/draft/2020-12/schema',
        **schema,
        'title': 'rig.yaml of PoroTwin',
        'description': 'A laboratory rig: size, sand, wells, camera and control. See docs/rig.md.',
    }
