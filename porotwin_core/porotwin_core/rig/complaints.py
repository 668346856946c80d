"""Validation errors of pydantic as one line for the owner of a rig."""

from pathlib import Path

import pydantic

_PURPOSE = {
    'name': 'a word for the rig',
    'width_m': 'the width of the sand box [m]',
    'height_m': 'the height of the sand box [m]',
    'depth_m': 'the distance between the plates [m], a number or {file:, variable:}',
    'porosity': 'the share of the volume that is pores, a number or {file:, variable:}',
    'permeability_m2': 'the permeability of the sand [m^2], a number or {file:, variable:}',
    'viscosity_pa_s': 'the viscosity of the water [Pa s]',
    'density_kg_m3': 'the density of the water [kg/m^3]',
    'wells': 'the wells by name, each with x_m and z_m',
    'x_m': 'the distance from the left edge [m]',
    'z_m': 'the height above the lower edge [m]',
    'corners_px': 'the four corners of the rig in the photographs',
    'disallowed_zone_m': 'the corners (x, z) of the zone without tracer [m]',
    'zone_m': 'the corners (x, z) of the zone [m]',
}
"""The meaning of keys that may be missing."""


def one_line(
    source: Path | str, error: pydantic.ValidationError, *, section: str = 'the description'
) -> str:
    """Return the most telling complaint of `error` as one line.

    Args:
        source: the file or message with the mistake; the line begins with it.
        error: all complaints; unknown keys come first, the number of others is added.
        section: the name of the whole, for complaints about no single key.
    """
    first = min(error.errors(), key=lambda item: item['type'] != 'extra_forbidden')
    parts = [str(part) for part in first['loc'] if part not in ('float', 'MapReference')]
    where = '.'.join(parts) or section
    more = f' (and {error.error_count() - 1} more)' if error.error_count() > 1 else ''
    reason = first['msg'].removeprefix('Value error, ')
    if first['type'] == 'extra_forbidden':
        return f"{source}: unknown key '{where}'; correct or remove it{more}"
    if first['type'] == 'missing':
        return f"{source}: '{where}' is missing: {_PURPOSE.get(parts[-1], 'needed')}{more}"
    if not parts:
        return f'{source}: {reason}{more}'
    return f'{source}: {where} = {first["input"]!r}: {reason}{more}'
