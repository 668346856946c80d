"""Files of maps in a folder, by their content."""

from pathlib import Path

from porotwin_core.basis.netcdf_file import open_netcdf

_DAMAGE = (RuntimeError, OSError, ValueError, LookupError, AttributeError, TypeError)
"""Exceptions of the NetCDF library at damaged bytes."""


def files_with_maps(folder: Path) -> list[str]:
    """Return the names of the readable NetCDF files in `folder` that hold tracer maps, sorted."""
    return [path.name for path in sorted(folder.glob('*.nc')) if _holds_maps(path)]


def _holds_maps(path: Path) -> bool:
    """Return whether the file has a variable `concentration` (time, z, x)."""
    try:
        with open_netcdf(path) as dataset:
            variable = dataset.variables.get('concentration')
            return variable is not None and variable.dimensions == ('time', 'z', 'x')
    except _DAMAGE:
        return False
