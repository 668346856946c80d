"""Are the files of the photographs whole, of one size, and each another one?"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby
from pathlib import PurePosixPath

from porotwin_checks.known import Known, PhotoFile
from porotwin_core.basis.check import Check
from porotwin_core.basis.remark import Remark, first_of

KEY = 'photographs'
NO_CAMERA = (
    'there are photographs, but no place of the rig in them; add camera.corners_px to rig.yaml'
)
UNREADABLE = '{names} cannot be read as pictures; copy them again or remove their lines'
CUT = '{names} end before their pictures do; copy them from the camera again'
SIZES = 'they have several sizes, {sizes}; corners_px fit one size only'
SAME = (
    '{names} are each the same file, byte for byte: the camera may have hung, or files were copied'
    '; leave copies out of imaging.csv'
)


def _find(known: Known) -> Iterator[Remark]:
    photos = known.seen_photos
    baselines = {photo.name for photo in known.photos if photo.role == 'baseline'}
    no_maps = not known.has('maps')  # they need every baseline
    if known.rig.camera is None:
        yield replace(Remark.of('camera', 'no_camera', NO_CAMERA), refused=True)
    unreadable = [photo.name for photo in photos if photo.size is None]
    if unreadable:
        told = Remark.of(KEY, 'unreadable_photos', UNREADABLE, names=first_of(unreadable))
        yield replace(told, refused=no_maps and not baselines.isdisjoint(unreadable))
    cut = [photo.name for photo in photos if photo.is_cut and photo.size is not None]
    if cut:
        told = Remark.of(KEY, 'cut_photos', CUT, names=first_of(cut))
        yield replace(told, refused=no_maps and not baselines.isdisjoint(cut))
    sizes = {photo.size for photo in photos if photo.size is not None}
    if len(sizes) > 1:
        shown = ', '.join(f'{width} x {height} px' for width, height in sorted(sizes))
        yield Remark.of(KEY, 'several_sizes', SIZES, sizes=shown)
    # a file in several lines is told by `photograph_list`, and counts once here
    named = [{PurePosixPath(one.name): one for one in run} for _, run in groupby(photos, _identity)]
    runs = [list(run.values()) for run in named if len(run) > 1]
    if runs:
        words = [f'{run[0].name} to {run[-1].name} ({len(run)} photographs)' for run in runs]
        rows = [{'first': r[0].name, 'last': r[-1].name, 'photographs': len(r)} for r in runs]
        yield Remark.of(KEY, 'same_files', SAME, names=first_of(words), runs=rows)


def _identity(photo: PhotoFile) -> object:
    """Return the same for equal files; a file that nobody could read equals no other."""
    return photo.digest or id(photo)


CHECK = Check(needs=('seen_photos',), find=_find)
