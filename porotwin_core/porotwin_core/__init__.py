"""Shared language of PoroTwin: rig, grid, well rates, units, messages to arrays and back."""

from importlib.metadata import version

__version__ = '0.1.0'

if int(version('pydantic').partition('.')[0]) < 2:  # Ubuntu 24.04 brings 1.10
    raise ImportError(
        f"PoroTwin needs pydantic 2, found {version('pydantic')}: pip install 'pydantic>=2'"
    )
