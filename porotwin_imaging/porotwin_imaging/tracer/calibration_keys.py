"""The content of a calibration file as YAML, with all its keys checked.

`calibration` describes the file and checks its values.
"""

from pathlib import Path
from typing import Any

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.likely_name import did_you_mean
from porotwin_core.basis.remark import QUOTED
from porotwin_core.rig.yaml_reader import read_yaml_file

FILE_NAME = 'calibration.yaml'
"""Name that `porotwin calibrate` gives the file."""
READ_SCHEMAS = (1, 2)
"""Versions that are read. Version 1 has no deviations of the response and of the factors."""
_NEEDED = ('schema', 'scale_error', 'signal', 'response')
"""Keys of every file."""
_OPTIONAL = ('made', 'sands', 'hidden', 'blur_px')
"""Keys that may be missing."""
_NEEDED_IN = {
    'signal': ('contrast', 'weights'),
    'response': ('signal', 'concentration'),
    'hidden': ('file',),
}
"""Keys that each section must have; `made` is free but for its rig."""
_OPTIONAL_IN = {
    'signal': ('absorbance',),
    'response': ('deviation',),
    'sands': ('file', 'factors', 'deviations'),
}
"""Keys that each section may have."""
_SECTIONS = ('made', 'signal', 'response', 'sands', 'hidden')
"""Keys whose values are sections."""
_RIG_KEYS = ('name', 'width_m', 'height_m')
"""Keys of `made.rig`."""


def read_content(path: Path) -> dict[str, Any]:
    """Return the content of the calibration file `path`: all needed keys, and no unknown ones.

    Optional sections without content are left out.

    Raises:
        InputError: the file is missing, no YAML, of another version, or a key is wrong; one line
            names the file, the key and the remedy.
    """
    if path.is_dir():
        raise InputError(f'{path}: is a folder; name the file in it: {path / FILE_NAME}')
    data = read_yaml_file(path, remedy='make one with: porotwin calibrate')
    if not isinstance(data, dict):
        found = 'is empty' if data is None else 'holds no keys'
        raise InputError(f'{path}: {found}; make a calibration with: porotwin calibrate')
    try:
        _check_schema(data)
        content = {key: value for key, value in data.items() if value is not None or key in _NEEDED}
        _check_keys('', content, _NEEDED, _OPTIONAL)
        for key in _SECTIONS:
            if key in content:
                _check_section(key, content[key])
        _check_rig(content.get('made', {}).get('rig'))
    except InputError as error:
        raise InputError(f'{path}: {error}') from None
    return content


def _check_schema(data: dict[str, Any]) -> None:
    """Raise InputError for a version of the file that is not read."""
    if 'schema' not in data:
        raise InputError("'schema' is missing; calibrate again")
    schema = data['schema']
    versions = ' or '.join(map(str, READ_SCHEMAS))
    if type(schema) is not int or schema < min(READ_SCHEMAS):
        raise InputError(f'schema: {schema!r} is not {versions}; calibrate again')
    if schema > max(READ_SCHEMAS):
        raise InputError(
            f'schema: {schema} is not {versions}, so a newer PoroTwin wrote the file; update '
            'PoroTwin, or calibrate again'
        )


def _check_section(name: str, section: Any) -> None:
    """Raise InputError unless the value of the key `name` is a section with the right keys."""
    if not isinstance(section, dict):
        said = f'{section!r}'[:QUOTED]
        example = f'{name}: {{file: {name}.png}}' if name == 'hidden' else f'{name}: {{key: value}}'
        raise InputError(f'{name}: {said} is no section; write it as {example}, or calibrate again')
    if name != 'made':  # for the reader, and different in older files
        _check_keys(f'{name}.', section, _NEEDED_IN.get(name, ()), _OPTIONAL_IN.get(name, ()))


def _check_keys(
    prefix: str, section: dict[str, Any], needed: tuple[str, ...], optional: tuple[str, ...]
) -> None:
    """Raise InputError for the first unknown or missing key; `prefix` is the section and a point.

    Unknown keys come first: one of them may be the missing key, misspelt.
    """
    known = (*needed, *optional)
    for key in section:
        if key not in known:
            guess = did_you_mean(key, known, within=prefix)
            remedy = f'correct or remove it; {guess}' if guess else 'correct or remove it'
            raise InputError(f"unknown key '{prefix}{key}'; {remedy}")
    for key in needed:
        if key not in section:
            raise InputError(f"'{prefix}{key}' is missing; calibrate again")


def _check_rig(rig: Any) -> None:
    """Raise InputError unless `made.rig` is absent, or has a name and a size."""
    if rig is None:
        return
    if not isinstance(rig, dict) or sorted(rig) != sorted(_RIG_KEYS):
        raise InputError(
            f'made.rig: needs {", ".join(_RIG_KEYS)} and no other keys; correct or remove it'
        )
    for key in _RIG_KEYS[1:]:
        if type(rig[key]) not in (int, float) or not 0 < rig[key] < float('inf'):
            said = f'{rig[key]!r}'[:QUOTED]
            raise InputError(f'made.rig.{key}: {said} is no length in metres; correct it')
