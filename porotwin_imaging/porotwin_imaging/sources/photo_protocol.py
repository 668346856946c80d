"""The protocol `imaging.csv` (time_s, path, role): times and roles of the files in a folder."""

from pathlib import Path

from porotwin_core.basis.photo_list import IMAGING_FILE, PhotoLine, read_photo_list
from porotwin_core.basis.remark import Remark


class GrowingProtocol:
    """The protocol in `folder` or its parent, read again when it changes; it may appear later.

    Attributes:
        entries: the lines by file; empty without a protocol.
    """

    def __init__(self, folder: Path) -> None:
        self._paths = (folder / IMAGING_FILE, folder.parent / IMAGING_FILE)
        self._stamp: tuple[Path, int, int] | None = None
        self._fault = ''
        self.entries: dict[Path, PhotoLine] = {}

    def refresh(self) -> tuple[bool, list[Remark]]:
        """Return whether the entries have changed, and problems, each once.

        A protocol with a fault is read again: its share may be away for a moment.
        """
        for path in self._paths:
            try:
                status = path.stat()
            except OSError:  # no protocol here
                continue
            stamp = (path, status.st_mtime_ns, status.st_size)
            if stamp == self._stamp:
                return False, []
            try:
                lines = list(read_photo_list(path))
                entries = {(path.parent / line.name).resolve(): line for line in lines}
            except ValueError as error:  # a zero in a name, or InputError
                fault, self._fault = self._fault, str(error)
                told = fault == self._fault
                remark = Remark(IMAGING_FILE, '', self._fault, '', code='wrong_protocol')
                return False, [] if told else [remark]
            self.entries, self._stamp, self._fault = entries, stamp, ''
            return True, []
        return False, []
