"""The files of photographs, as the checks look at them."""

import hashlib
import io
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field

from PIL import Image, UnidentifiedImageError

from porotwin_checks.known import PhotoFile
from porotwin_core.basis.errors import InputError
from porotwin_imaging.photograph.jpeg_file import JPEG_START
from porotwin_imaging.photograph.photo_file import PNG_START, is_complete
from porotwin_recording.tables.photos import Photo


@dataclass
class SeenPhotos:
    """Keeps the facts of every photograph that was read."""

    _known: dict[Photo, PhotoFile] = field(default_factory=dict, init=False)

    def note(self, photo: Photo, content: bytes) -> None:
        """Keep the facts in the `content` of the file of a `photo`. No end of a TIFF is judged.

        Pillow reads the size of more formats than imaging, and warns of files that it refuses.
        """
        is_cut = content.startswith((JPEG_START, PNG_START)) and not is_complete(content)
        size = None
        try:
            with warnings.catch_warnings():
                warnings.simplefilter('ignore')
                with Image.open(io.BytesIO(content)) as picture:
                    size = picture.size
        except (UnidentifiedImageError, OSError, ValueError, Image.DecompressionBombError):
            pass
        digest = hashlib.sha256(content).digest()
        self._known[photo] = PhotoFile(photo.name, size, is_cut, digest)

    def of(self, photos: Sequence[Photo]) -> list[PhotoFile]:
        """Return the facts of `photos`; files that were not noted yet are read now."""
        for photo in photos:
            if photo not in self._known:
                try:
                    self.note(photo, photo.read())
                except (InputError, OSError):
                    self._known[photo] = PhotoFile(photo.name, None, False, b'')
        return [self._known[photo] for photo in photos]
