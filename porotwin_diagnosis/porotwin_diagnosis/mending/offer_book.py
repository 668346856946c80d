"""The offers to the operator: made from sure findings and answered once."""

from dataclasses import dataclass, replace
from enum import Enum

from porotwin_core.basis.errors import InputError
from porotwin_diagnosis.decision.verdict import UNEXPLAINED
from porotwin_diagnosis.mending.finding import Finding

NEW_EVIDENCE = 1.25
"""Factor by which the error of the model has grown when a declined cause is offered again."""

REPEATED_CONFIDENCE = 0.72
"""Least confidence of a cause that two diagnoses have named, and none between them another answer
than unexplained. A single effect that leaves nearly what a true one may leave has 0.73, scant
evidence at most 0.7.
The second diagnosis has seen more photographs, and shadow forecasts judge an accepted effect."""


class OfferState(Enum):
    """The state of an offer; `MendOffer` has the same values."""

    OFFERED = 0
    ACCEPTED = 1
    REFUSED = 2
    TAKEN_BACK = 3
    EXPIRED = 4


@dataclass(frozen=True)
class Offer:
    """An offer to the operator.

    Attributes:
        sequence: its number, from 1.
        state: its state.
        stamp: time of the last photograph in the diagnosis [s].
        finding: the verdict behind it.
        sentence: the present text for the operator.
    """

    sequence: int
    state: OfferState
    stamp: float
    finding: Finding
    sentence: str

    @property
    def is_notice(self) -> bool:
        """Whether the offer is only a notice about a defect of the camera."""
        return not self.finding.effects

    @property
    def is_open(self) -> bool:
        """Whether it waits for an answer."""
        return self.state is OfferState.OFFERED and not self.is_notice


class OfferBook:
    """The newest offer, and the causes that were declined before."""

    def __init__(self, least_confidence: float) -> None:
        """Offer findings of at least this confidence [-], or less surely named twice."""
        self._least_confidence = least_confidence
        self._last: Finding | None = None
        self._declined: list[Finding] = []
        self.newest: Offer | None = None

    @property
    def open(self) -> Offer | None:
        """The offer that waits for an answer."""
        return self.newest if self.newest is not None and self.newest.is_open else None

    def consider(self, finding: Finding, stamp: float) -> tuple[list[Offer], str]:
        """Return the changed offers in their order, and a line with the reason for no offer.

        Args:
            finding: the newest verdict.
            stamp: time of the last photograph in the diagnosis [s].
        """
        waiting = self.open
        if (
            waiting is not None
            and waiting.finding.has_the_cause_of(finding)
            and waiting.finding.has_the_size_of(finding)
        ):
            return [], f'offer {waiting.sequence} already says so and waits for an answer'
        changed = self.expire(f'a newer diagnosis says {finding.verdict.replace("_", " ")}')
        doubt = finding.doubt(self._needed(finding)) or self._old_news(finding)
        if finding.verdict != UNEXPLAINED:  # which contradicts no cause
            self._last = finding
        if doubt:
            return changed, doubt
        number = self.newest.sequence + 1 if self.newest is not None else 1
        self.newest = Offer(number, OfferState.OFFERED, stamp, finding, finding.sentence)
        if self.newest.is_notice:
            self._decline(finding)
        return [*changed, self.newest], ''

    def _needed(self, finding: Finding) -> float:
        """Return the least confidence [-] of an offer of this finding."""
        last = self._last
        twice = (
            last is not None
            and last.has_the_cause_of(finding)
            and last.confidence >= REPEATED_CONFIDENCE
        )
        return min(self._least_confidence, REPEATED_CONFIDENCE) if twice else self._least_confidence

    def expire(self, why: str) -> list[Offer]:
        """Make the open offer void, and return it; return nothing if no offer is open."""
        waiting = self.open
        if waiting is None:
            return []
        return [self._now(OfferState.EXPIRED, f'Offer {waiting.sequence} is void: {why}.')]

    def _old_news(self, finding: Finding) -> str:
        declined = [one.error_before for one in self._declined if one.has_the_cause_of(finding)]
        if not declined or finding.error_before > NEW_EVIDENCE * declined[-1]:
            return ''
        return f'{finding.verdict} was declined before, and the gap has not grown since'

    def check(self, sequence: int) -> Offer:
        """Return the open offer `sequence`.

        Raises:
            InputError: there is no such offer, or it is not open.
        """
        newest = self.newest
        if newest is None:
            raise InputError('nothing has been offered yet; wait for an offer')
        if sequence > newest.sequence or sequence == 0:
            raise InputError(f'offer {sequence} does not exist; the newest is {newest.sequence}')
        if sequence < newest.sequence:
            raise InputError(
                f'offer {sequence} is not open any more: offer {newest.sequence} has followed'
            )
        if newest.is_notice:
            raise InputError(f'offer {sequence}: only a notice; there is nothing to accept')
        if not newest.is_open:
            state = newest.state.name.lower().replace('_', ' ')
            raise InputError(f'offer {sequence} is {state} already; wait for the next one')
        return newest

    def accept(self) -> Offer:
        """Note that the newest offer is accepted, and its effects act."""
        newest = self._given()
        sentence = f'Accepted: {newest.finding.sentence} The next photographs judge it.'
        return self._now(OfferState.ACCEPTED, sentence)

    def refuse(self, why: str = 'the operator') -> Offer:
        """Note that the newest offer is refused; `why` gives the origin of the refusal."""
        newest = self._given()
        self._decline(newest.finding)
        return self._now(OfferState.REFUSED, f'Refused by {why}: {newest.finding.sentence}')

    def confirm(self, words: str) -> Offer:
        """Note that forecasts are better since the acceptance; `words` give the errors."""
        return self._now(OfferState.ACCEPTED, f'Kept: {self._given().finding.sentence} {words}')

    def take_back(self, words: str) -> Offer:
        """Note that the accepted effects were removed; `words` give the reason."""
        newest = self._given()
        self._decline(newest.finding)
        return self._now(OfferState.TAKEN_BACK, f'Taken back: {words}')

    def _decline(self, finding: Finding) -> None:
        self._declined.append(finding)

    def _given(self) -> Offer:
        assert self.newest is not None
        return self.newest

    def _now(self, state: OfferState, sentence: str) -> Offer:
        self.newest = replace(self._given(), state=state, sentence=sentence)
        return self.newest
