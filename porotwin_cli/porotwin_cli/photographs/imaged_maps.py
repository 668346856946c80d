"""The photographs of an experiment as a file of maps; a second call goes on with an interrupted
one."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from porotwin_checks.known import PhotoFile
from porotwin_cli.photographs.many_photos import each_photo
from porotwin_cli.photographs.map_sureness import Doubt, doubt_entry, plume_doubt
from porotwin_cli.photographs.photo_remarks import PhotoRemarks
from porotwin_cli.photographs.seen_photos import SeenPhotos
from porotwin_cli.terminal import WorkFailed, progress, say
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import Crew
from porotwin_core.rig import Rig
from porotwin_imaging.baseline.baseline import Baseline
from porotwin_imaging.photo_to_map import ConcentrationMap, concentration_map
from porotwin_recording.experiment.recording import Recording
from porotwin_recording.tables.concentration import open_maps
from porotwin_recording.tables.map_parts import MapParts
from porotwin_recording.tables.photos import Photo


@dataclass(frozen=True)
class ExperimentPhotos:
    """The photographs of an experiment.

    Attributes:
        baselines: photographs without tracer, at least one.
        states: photographs of the experiment, at least one.
        baseline_files: files of the baselines, for messages.
    """

    baselines: list[Photo]
    states: list[Photo]
    baseline_files: list[str]

    @classmethod
    def of(cls, recording: Recording, experiment: Path) -> 'ExperimentPhotos':
        """Return the photographs of `recording`, read from `experiment`.

        Raises:
            InputError: there is no baseline, or no other photograph.
        """
        baselines = [photo for photo in recording.photos if photo.role == 'baseline']
        states = [photo for photo in recording.photos if photo.role == 'state']
        if not baselines or not states:
            raise InputError(
                f'{experiment}: needs a baseline and at least one state photograph; '
                'give their times and roles in imaging.csv (docs/formats.md)'
            )
        return cls(baselines, states, [str(experiment / photo.name) for photo in baselines])


@dataclass
class ImagedMaps:
    """The maps that were made.

    Attributes:
        entries: an entry of a JSON answer for each map.
        doubts: the doubt about the plume of each map.
        refused: a line for each photograph that makes no map.
        seen: the files of the photographs, in their order.
    """

    entries: list[dict[str, Any]] = field(default_factory=list)
    doubts: list[Doubt] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    seen: Sequence[PhotoFile] = ()

    def add(self, photo: Photo, doubt: Doubt, remarks: Sequence[str]) -> None:
        """Add the map of `photo`."""
        self.doubts.append(doubt)
        self.entries.append(
            {
                'time_s': photo.time,
                'photo': photo.name,
                'remarks': remarks,
                'plume': doubt_entry(doubt),
            }
        )


def write_maps(
    writing: MapParts, rig: Rig, states: Sequence[Photo], baseline: Baseline, crew: Crew
) -> ImagedMaps:
    """Write the maps of the photographs `states`; tell progress, remarks and refusals.

    Args:
        writing: receives the maps; it knows the ones from an interrupted call.
        rig: the rig.
        states: the photographs.
        baseline: the baseline, with the calibration.
        crew: images several photographs at a time; it is left at the end.

    Raises:
        WorkFailed: no photograph could be used.
    """
    done, left = _done_and_left(states, writing.earlier)
    if writing.changed:
        say(f'beginning anew: {", ".join(writing.changed)} changed since an interrupted call')
    if done:
        say(f'going on behind {len(done)} maps of an interrupted call')
    made, remarks, seen = ImagedMaps(), PhotoRemarks(say), SeenPhotos()
    with crew, writing as writer, progress() as bar:
        task = bar.add_task('photographs', total=len(states), completed=len(done))
        for photo, found in each_photo(crew, concentration_map, left, baseline, seen.note):
            try:
                doubt, status = _append(writer, photo, found)
            except InputError as error:
                made.refused.append(f'{photo.name}: {error}')
                say(made.refused[-1])
            else:
                remarks.tell(photo.name, status if baseline.calibrated else status[1:])
                made.add(photo, doubt, status)
            bar.advance(task)
        if not made.entries and not done:
            raise WorkFailed('no photograph could be used')
    before = _imaged_before(writing.path, rig, done) if done else ImagedMaps()
    remarks.tell_the_rest()
    return ImagedMaps(
        [*before.entries, *made.entries],
        [*before.doubts, *made.doubts],
        made.refused,
        seen.of(states),
    )


def _append(
    writer: MapParts, photo: Photo, found: ConcentrationMap | InputError
) -> tuple[Doubt, Sequence[str]]:
    """Append the map that was `found` in a photograph; return the doubt about it and its remarks.

    Raises:
        InputError: none was found, or the map cannot follow the one before.
    """
    if isinstance(found, InputError):
        raise found
    writer.append(photo.time, found.values, deviation=found.deviation, systematic=found.systematic)
    return plume_doubt(found.values, found.deviation, found.systematic), found.status


def _done_and_left(
    states: Sequence[Photo], earlier: Sequence[float]
) -> tuple[list[Photo], list[Photo]]:
    """Return the photographs of the maps at the `earlier` times [s], and the others.

    Photographs that an interrupted call refused are among the others: they tell their reasons once
    more.
    """
    waiting = set(earlier)
    done: list[Photo] = []
    left: list[Photo] = []
    for photo in states:
        (done if photo.time in waiting else left).append(photo)
        waiting.discard(photo.time)
    return done, left


def _imaged_before(output: Path, rig: Rig, photos: Sequence[Photo]) -> ImagedMaps:
    """Return the maps in the file `output` that an interrupted call had made of `photos`."""
    found = ImagedMaps()
    for photo, fields in zip(photos, open_maps(output, rig).with_deviations(), strict=False):
        values, deviation, systematic = fields
        assert deviation is not None and systematic is not None
        found.add(photo, plume_doubt(values, deviation, systematic), ['imaged by an earlier call'])
    return found
