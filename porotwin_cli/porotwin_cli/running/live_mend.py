"""Shows and answers the offers of a running graph to mend its model."""

import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, Self

from porotwin_cli.running.live_diagnosis import POLL_S, SEARCH_S
from porotwin_cli.running.live_node import listening, live_node, silent
from porotwin_cli.terminal import WorkFailed
from porotwin_core.basis.errors import InputError
from porotwin_core.ros import conversions, qos
from porotwin_core.ros.following import follow
from porotwin_core.ros.senders import LONGEST_SEARCH_S, TERMINAL
from porotwin_core.ros.service_answer import twin_answer_within
from porotwin_core.ros.vouching import Voucher
from porotwin_hub.launching.graph import NAMESPACE
from porotwin_msgs.msg import MendOffer, Outcome
from porotwin_msgs.srv import AnswerMend
from porotwin_page.mend_answer import LONGEST_ANSWER_S

ANSWERS = 'mend/answer'
"""Service of the mend node."""


@dataclass(frozen=True)
class OfferShown:
    """The newest offer: its number, its state in words, whether it can be answered, its words."""

    sequence: int
    state: str
    open: bool
    sentence: str
    report: str


class MendDesk:
    """Listens to offers and answers them; a context manager with a thread of its own."""

    def __init__(
        self,
        on_offer: Callable[['MendDesk', MendOffer], None] | None = None,
        *,
        namespace: str = NAMESPACE,
    ) -> None:
        """Prepare to listen; `on_offer` is called with this desk and every offer."""
        self._namespace = namespace
        self._on_offer = on_offer
        self._listening = ExitStack()
        self._arrived = threading.Event()
        self.newest: MendOffer | None = None

    def __enter__(self) -> Self:
        self._node = node = live_node(TERMINAL, namespace=self._namespace)
        follow(node, MendOffer, 'mend/offer', self._take, qos.CONFIG)
        self._calling: tuple[Any, Voucher] | None = None  # who only looks does not call
        self._listening.enter_context(listening(node))
        return self

    def __exit__(self, *_: object) -> None:
        self._listening.close()

    def _take(self, message: MendOffer) -> None:
        self.newest = message
        self._arrived.set()
        if self._on_offer is not None:
            self._on_offer(self, message)

    def send(self, sequence: int, *, accept: bool) -> Any:
        """Send an answer, and return the future of its outcome."""
        client, request = self._asking(sequence, accept=accept)
        return client.call_async(request)

    def _asking(self, sequence: int, *, accept: bool) -> tuple[Any, AnswerMend.Request]:
        """Return the client and the request of an answer, which this node vouches for."""
        if self._calling is None:
            client = self._node.create_client(AnswerMend, ANSWERS)
            client.wait_for_service(SEARCH_S)
            self._calling = client, Voucher(self._node)
        client, voucher = self._calling
        request = AnswerMend.Request(sequence=sequence, accept=accept)
        voucher.vouch(ANSWERS, request)
        return client, request

    def wait_for_node(self) -> None:
        """Return when the mend node answers.

        Raises:
            WorkFailed: there is none.
        """
        name, deadline = self._node.resolve_service_name(ANSWERS), time.monotonic() + SEARCH_S
        while not self._node.count_services(name) and time.monotonic() < deadline:
            time.sleep(POLL_S)
        if not self._node.count_services(name):
            raise silent('mend', 'up --mend ask')

    def offer(self) -> OfferShown | None:
        """Return the newest offer; None if nothing has been offered."""
        self._arrived.wait(LONGEST_SEARCH_S)
        newest = self.newest
        if newest is None:
            return None
        return OfferShown(
            newest.sequence,
            *conversions.offer_state_from_msg(newest),
            newest.sentence,
            newest.report,
        )

    def answer(self, sequence: int, *, accept: bool) -> None:
        """Answer an offer.

        Raises:
            InputError: the offer is not open, the solver refuses its effects, or another node
                answers as well.
            WorkFailed: no answer came, or the solver is silent.
        """
        client, request = self._asking(sequence, accept=accept)
        response = twin_answer_within(self._node, client, request, LONGEST_ANSWER_S)
        if response is None:
            raise WorkFailed(
                f'the mend node did not answer within {LONGEST_ANSWER_S:g} s; try again'
            )
        outcome = response.outcome
        if outcome.code == Outcome.INVALID_INPUT:
            raise InputError(outcome.message)
        if outcome.code != Outcome.OK:
            raise WorkFailed(outcome.message)


def accept_all(desk: MendDesk, message: MendOffer) -> None:
    """Accept every offer at once: the operator of a demo."""
    if conversions.offer_state_from_msg(message)[1]:
        desk.send(message.sequence, accept=True)
