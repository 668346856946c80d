"""What maps and exports are made from, as fingerprints: does an earlier work still hold?"""

import hashlib
import json
from pathlib import Path
from typing import Any

from porotwin_recording.experiment.experiment_folder import MAPS_FILE
from porotwin_recording.experiment.recording import Recording
from porotwin_recording.tables.photos import Photo


def fingerprints(recording: Recording) -> dict[str, str]:
    """Return a short hash of everything in `recording` that its maps depend on, by its name.

    A file counts by its path, its size and the time of its last change, a photograph also by its
    time and role. The rig counts whole, with the camera. The rates count because the core of the
    plume corrects a calibration.
    """
    rig = recording.rig
    files = {photo.path or recording.source for photo in recording.photos}
    return {
        'photographs': _short_hash(
            [
                [_identity(photo) for photo in recording.photos],
                sorted(change for file in files for change in _changes(file)),
            ]
        ),
        'rig.yaml': _short_hash([rig.physics_fingerprint, rig.model_dump(mode='json')]),
        'rates': _short_hash(repr(recording.known_rates)),
    }


def content_mark(recording: Recording) -> str:
    """Return a short hash of all files that hold the content of `recording`.

    Experiments of one bag have the same.
    """
    maps = recording.source / MAPS_FILE
    held = maps if maps.is_file() else recording.source
    return _short_hash([fingerprints(recording), _changes(held)])


def _identity(photo: Photo) -> list[Any]:
    return [photo.time, photo.role, photo.name, photo.concentration]


def _changes(file: Path) -> list[list[Any]]:
    """Return path, size [B] and time of the last change [ns] of a file, or of a bag's files."""
    files = [file] if file.is_file() else sorted(file.rglob('*.mcap*'))
    stats = [(one, one.stat()) for one in files]
    return [[str(one.resolve()), stat.st_size, stat.st_mtime_ns] for one, stat in stats]


def _short_hash(value: Any) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()[:16]
