"""Forwarding the photographs of a camera source, whatever fails on the way."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from porotwin_core.basis.remark import Remark
from porotwin_imaging.photograph.file_names import one_line, printable
from porotwin_imaging.photograph.photo_clock import ClockMemory, TimeEvidence, Trust, stamps
from porotwin_imaging.photograph.sent_photos import SentPhoto, SentPhotos, digest_of
from porotwin_imaging.sources.baseline_choice import BaselineChoice
from porotwin_imaging.sources.camera_source import (
    CameraPhoto,
    CameraSource,
    OrderingSource,
    Polled,
    ResumableSource,
)

SayFn = Callable[[str], None]
"""Takes one line for the log."""


class PhotoForwarder:
    """Sends each photograph of a source once, with a stamp that the twin can believe.

    A restarted camera node would meet the same file and fail again. Therefore no error ends the
    forwarding; each becomes a problem.

    Args:
        source: gives the photographs.
        send: called with each photograph; its role and time are set.
        report: called with each problem.
        say: called with each remark.
        sent: the photographs that were sent before.
        interval_s: usual time between photographs [s].
        trust: the first time of a photograph that may be believed.

    Attributes:
        interval_s: usual time between photographs [s].
        absent: one line while the source does not answer, else empty.
        arriving: whether a photograph was arriving at the last look.
    """

    def __init__(
        self,
        source: CameraSource,
        *,
        send: Callable[[CameraPhoto], None],
        report: Callable[[Remark], None],
        say: SayFn,
        sent: SentPhotos,
        interval_s: float,
        trust: Trust = 'exif',
    ) -> None:
        self._source = source
        self._send = send
        self._report = report
        self._say = say
        self._sent = sent
        self._repeated = ''
        """Name of the photograph that came last under another name."""
        self._roles = BaselineChoice(any_sent=sent.any_sent)
        self._memory_problem = ''
        self.interval_s = interval_s
        self.trust = trust
        self.absent = ''
        self.arriving = False
        self._clock = ClockMemory()
        if sent.last is not None:
            self._clock = ClockMemory(sent.last.stamp, sent.last.correction)
        if isinstance(source, ResumableSource):
            source.resume(sent)

    @property
    def trust(self) -> Trust:
        """The first time of a photograph that may be believed; it may change at any time."""
        return self._trust

    @trust.setter
    def trust(self, value: Trust) -> None:
        self._trust = value
        if isinstance(self._source, OrderingSource):
            self._source.trust = value

    def send_baselines_again(self) -> None:
        """Send the baselines of an earlier start, which the topic offers to late subscribers."""
        for stamp, data in self._sent.baselines():
            self._send(CameraPhoto(data, stamp, 'baseline of an earlier start', 'baseline'))

    def forward(self) -> None:
        """Poll the source once, send the new photographs and report the problems."""
        self._sent.keep()
        if self._sent.problem != self._memory_problem:
            self._memory_problem = self._sent.problem
            self._complain('camera', self._sent.problem, 'memory')
        try:
            polled = self._source.poll()
        except Exception as error:
            polled = Polled([], [], f'looking for photographs failed: {error!r}')
        self._note_absence(polled.absent)
        self.arriving = polled.arriving
        for line in polled.remarks:
            self._say(one_line(line))
        new = [photo for photo in polled.photos if self._is_new(photo)]
        photos, problems, *_ = self._roles.with_roles(polled._replace(photos=new))
        for problem in problems:
            self._tell(problem)
        for photo in self._stamped(photos):
            self._forward_one(photo)

    def keep(self) -> None:
        """Make the memory of the last photographs last; call it before the end."""
        self._sent.keep()

    def _stamped(self, photos: Sequence[CameraPhoto]) -> list[CameraPhoto]:
        """Return the photographs with their stamps; those without one are reported and left out."""
        evidence = [
            replace(
                photo.evidence or TimeEvidence(printable(photo.name), photo.time),
                in_sequence=photo.role != 'baseline',
            )
            for photo in photos
        ]
        found, self._clock = stamps(
            evidence, self._clock, interval_s=self.interval_s, trust=self.trust
        )
        for photo, stamp in zip(photos, found, strict=True):
            for remark in stamp.remarks:
                self._complain(photo.name, remark, 'time')
            if stamp.time is None:
                self._sent.add(SentPhoto(photo.name, digest_of(photo.data), photo.mark))
        return [
            replace(photo, time=stamp.time)
            for photo, stamp in zip(photos, found, strict=True)
            if stamp.time is not None
        ]

    def _is_new(self, photo: CameraPhoto) -> bool:
        """Return whether the bytes of a photograph are new; report the same bytes once more."""
        digest = digest_of(photo.data)
        before = self._sent.claim(digest, photo.name)
        if before is None:
            return True
        if before != photo.name:
            again = before == self._repeated
            frozen = ', again: the camera is frozen; restart it' if again else ''
            self._complain(
                photo.name, f"is a duplicate of '{before}'; left out{frozen}", 'duplicate'
            )
            self._repeated = before
        self._sent.add(SentPhoto(photo.name, digest, photo.mark))
        return False

    def _forward_one(self, photo: CameraPhoto) -> None:
        try:
            self._send(photo)
        except Exception as error:
            self._complain(photo.name, f'cannot be sent: {error!r}', 'unsent')
        if photo.role == 'baseline':
            self._sent.keep_baseline(photo.time, photo.data)
        self._sent.add(
            SentPhoto(
                photo.name, digest_of(photo.data), photo.mark, photo.time,
                self._clock.correction, photo.role or '',
            )
        )  # fmt: skip

    def _note_absence(self, absent: str) -> None:
        """Report that the source does not answer, or answers again, once each."""
        if bool(absent) != bool(self.absent):
            if absent:
                self._complain('camera', absent, 'absent')
            else:
                self._say('the camera answers again')
        self.absent = one_line(absent)

    def _complain(self, name: str, line: str, code: str) -> None:
        if line:
            why, _, remedy = line.partition('; ')
            self._tell(Remark(name, '', why, remedy, code=code))

    def _tell(self, problem: Remark) -> None:
        """Report a problem in text that logs and ROS accept."""
        key, why, remedy = printable(problem.key), one_line(problem.why), one_line(problem.remedy)
        self._report(replace(problem, key=key, why=why, remedy=remedy))
