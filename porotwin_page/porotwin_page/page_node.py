"""The page as a node: stores messages, serves them, and passes confirmations on."""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.clock import Clock, ClockType
from std_msgs.msg import Header

from porotwin_core.basis.errors import InputError
from porotwin_core.clock.stamps import believed_age
from porotwin_core.rates.wells import RateStep, without_water
from porotwin_core.rates.wells import WellRates as RatesByWell
from porotwin_core.rig import load_rig
from porotwin_core.ros import conversions, qos, senders
from porotwin_core.ros.following import follow
from porotwin_core.ros.foreign_words import FewWords, in_short
from porotwin_core.ros.node import (
    DIAGNOSTICS,
    ENDED,
    STALE_AFTER,
    Diagnostics,
    TwinNode,
    declare,
    hardware_id,
    run,
)
from porotwin_core.ros.node_health import CALLBACK_PATIENCE_S
from porotwin_core.ros.senders import LONGEST_SEARCH_S
from porotwin_core.ros.service_answer import twin_answer_within
from porotwin_core.ros.vouching import Voucher
from porotwin_msgs.msg import (
    CleanState,
    CycleReport,
    Forecast,
    MendOffer,
    NewState,
    Outcome,
    RigDescription,
    Setpoint,
    TracerField,
    WellRates,
)
from porotwin_msgs.srv import AnswerMend, ConfirmRates, WhatIf
from porotwin_page import address, graph_snapshot
from porotwin_page.access import Access, new_token, parse_hosts, token_in
from porotwin_page.confirmation import Confirmation
from porotwin_page.expectation import Expectation, plume_outlines
from porotwin_page.graph_snapshot import HISTORY_LENGTH
from porotwin_page.mend_answer import LONGEST_ANSWER_S, MendAnswer
from porotwin_page.past_states import PastStates
from porotwin_page.rigs import RigList, announce, named_pages
from porotwin_page.server import (
    ConfirmationUnavailable,
    PageApplication,
    ServerThread,
    SiblingsUnavailable,
    StreamSettings,
)
from porotwin_page.setpoint_source import SetpointSource
from porotwin_page.snapshot_store import SnapshotStore

LEVELS = {
    DiagnosticStatus.OK: graph_snapshot.Level.OK,
    DiagnosticStatus.WARN: graph_snapshot.Level.WARN,
    DiagnosticStatus.STALE: graph_snapshot.Level.SILENT,
}
NODES_PERIOD = 2.0
"""Period of the search for nodes in the graph [s]."""

SETPOINT_TOPIC = 'wells/setpoint'

ANSWER_TIMEOUT = 20.0
"""Longest wait for the outlook of proposed rates [s]; the siblings take about a second."""


def _own_name(host: str) -> frozenset[str]:
    """Return the name that the page listens at; addresses are compared with every connection."""
    return frozenset() if host in address.ALL_INTERFACES else frozenset({host.lower()})


class PageNode(TwinNode):
    """Serves the page; the only change it makes to the graph is a confirmation."""

    def __init__(self, **kwargs: Any) -> None:
        """Read the parameters and start the server; `kwargs` are passed on to `Node`.

        Raises:
            InputError: a parameter or the rig description is wrong, or the address is in use.
        """
        super().__init__('page', **kwargs)
        self._store = SnapshotStore()
        self._complaints = FewWords(self.get_logger().error, known=senders.SENDERS)
        self._simulated = self.simulated
        self._ends = False
        rig = declare(self, 'rig', '', 'path of rig.yaml; empty: from rig/description')
        self._knows_rig = bool(rig)
        if self._simulated:
            self._store.update(replace, began=0.0)
        if rig:
            self._store.update(replace, rig=load_rig(rig))
        preparation = declare(self, 'preparation', '', 'text on the work before the graph runs')
        self._store.update(replace, preparation=preparation)
        address_text = declare(
            self, 'address', '127.0.0.1:8765', 'HOST:PORT of the page; host 0.0.0.0: for phones too'
        )
        hosts = declare(self, 'hosts', '', 'other names of this machine in a browser, with commas')
        token_file = declare(
            self, 'token_file', '', 'file with the token for confirmations; empty: a new token'
        )
        self._confirm_timeout = declare(
            self,
            'confirm_timeout_s',
            5.0,
            'longest wait for the answer of the operator node [s]',
            at_least=0.1,
            at_most=60.0,
            on_change=self._set_confirm_timeout,
        )
        browsers = declare(
            self, 'browsers', 64, 'largest number of browsers at a time', at_least=1, at_most=1000
        )
        states = declare(
            self,
            'states_kept',
            HISTORY_LENGTH,
            'earlier states for the time slider; 0: none',
            at_least=0,
            at_most=100_000,
        )
        named = declare(self, 'rigs', '', 'pages of other rigs: NAME=http://HOST:PORT, with commas')
        rigs = named_pages(named)
        listening = address.listen(address_text)
        host, port = address.parse(address_text)[0], listening.getsockname()[1]
        token = token_in(Path(token_file)) if token_file else new_token()
        access = Access(token, parse_hosts(hosts) | _own_name(host))
        self._source = SetpointSource(senders.full_name(self, senders.GUARD))
        self._past = PastStates(most=states)
        self._what_if_client = self.create_client(WhatIf, 'siblings/what_if')
        self._mend_client = self.create_client(AnswerMend, 'mend/answer')
        self._voucher = Voucher(self)
        self._confirm_client = self.create_client(ConfirmRates, 'operator/confirm')
        self._diagnostics = Diagnostics(self)
        self._make_subscriptions()
        self._application = PageApplication(
            self._store,
            self._confirm,
            self._graph_time,
            access,
            ask=self._ask,
            mend=self._answer_offer,
            past=self._past,
            rigs=RigList(port, rigs),
            settings=StreamSettings(limit=browsers),
        )
        self._announced = announce(self.get_namespace(), self.context.get_domain_id(), host, port)
        self._url = f'http://{address.written(host, port)}'
        for line in address.page_lines(address.written(host, port), token):
            self.get_logger().info(line)
        if not address.is_local(host):
            self.get_logger().warning(
                'everyone who reaches this machine can see the page; confirming needs the token'
            )
        # the graph's clock may stand still
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(NODES_PERIOD, self._update_nodes, clock=steady)
        # the last step: an interrupt before it leaves no thread that waits for an answer
        self._server = ServerThread(self._application.make(), listening)

    def _set_confirm_timeout(self, value: float) -> None:
        self._confirm_timeout = value

    def _make_subscriptions(self) -> None:
        for message_type, topic, callback, profile in (
            (RigDescription, 'rig/description', self._on_rig, qos.CONFIG),
            (Header, 'asset/experiment', self._on_experiment, qos.CONFIG),
            (NewState, 'asset/new_state', self._on_new_state, qos.FIELD),
            (CleanState, 'asset/clean_state', self._on_clean_state, qos.FIELD),
            (TracerField, 'tracer/predicted', self._on_predicted, qos.FIELD),
            (TracerField, 'tracer/corrected', self._on_corrected, qos.FIELD),
            (Setpoint, SETPOINT_TOPIC, self._on_setpoint, qos.SETPOINT),
            (WellRates, 'wells/measured', self._on_measured, qos.FIELD),
            (CycleReport, 'hub/cycle', self._on_cycle, qos.FIELD),
            (Forecast, 'siblings/forecast', self._on_forecast, qos.CONFIG),
            (MendOffer, 'mend/offer', self._on_offer, qos.CONFIG),
        ):
            take = self._checked(topic, callback)
            follow(self, message_type, topic, take, profile, refuse=self._complaints.tell)
        self.create_subscription(
            DiagnosticArray, DIAGNOSTICS, self._checked(DIAGNOSTICS, self._on_diagnostics), 10
        )

    def _checked(self, topic: str, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        def checked(message: Any) -> None:
            try:
                callback(message)
            except Exception as error:  # no message of a foreign node may end the page
                self._complaints.tell(topic, f'{topic} is not shown: {in_short(str(error))}')

        return checked

    def _graph_time(self) -> float | None:
        """Return the time [s] for the ends of setpoints; None before simulated time has begun."""
        return self.now() or None

    def _on_rig(self, message: RigDescription) -> None:
        if not self._knows_rig:  # the message tells no pauses, the file does
            self._store.update(replace, rig=conversions.rig_from_msg(message))

    def _on_experiment(self, message: Header) -> None:
        self._store.update(replace, began=conversions.time_from_msg(message.stamp))

    def _map(self, message: TracerField) -> graph_snapshot.Map:
        concentration, grid = conversions.tracer_from_msg(message)
        return graph_snapshot.Map(
            conversions.time_from_msg(message.header.stamp), concentration, grid
        )

    def _on_new_state(self, message: NewState) -> None:
        state = graph_snapshot.ObservedState(
            sequence=message.sequence,
            map=self._map(message.tracer),
            arrival=time.monotonic(),
            time_step=conversions.seconds_from_msg(message.time_step),
            noise=message.noise,
            calibrated=message.calibrated,
            remarks=tuple(message.remarks),
        )
        self._store.update(graph_snapshot.with_observed_state, state)
        try:
            self._past.add(self._store.snapshot)
        except OSError as error:
            self.get_logger().warning(
                f'state {message.sequence} is left out of the time slider: {error}', once=True
            )

    def _on_clean_state(self, message: CleanState) -> None:
        time_s = conversions.time_from_msg(message.header.stamp)
        if message.cause == CleanState.START:
            self._store.update(graph_snapshot.with_new_experiment, time_s)
        elif message.cause == CleanState.FINISHED:
            self._store.update(graph_snapshot.with_end, message.reason)
        else:
            self._store.update(
                graph_snapshot.with_interruption, graph_snapshot.Mark(time_s, message.reason)
            )

    def _on_predicted(self, message: TracerField) -> None:
        self._store.update(graph_snapshot.with_predicted, self._map(message))

    def _on_corrected(self, message: TracerField) -> None:
        self._store.update(graph_snapshot.with_corrected, self._map(message))

    def _on_setpoint(self, message: Setpoint) -> None:
        taken = conversions.time_from_msg(message.header.stamp)
        until = conversions.time_from_msg(message.valid_until)
        now = self._graph_time()
        age = believed_age(taken, self.now(), until - taken, simulated=self._simulated)
        setpoint = graph_snapshot.Setpoint(
            sequence=message.sequence,
            time=taken,
            valid_until=until,
            rates=conversions.rates_from_msg(message.wells),
            reason=message.reason,
            arrival=None if now is None else now - age,
            clock=time.time(),
            doubt=self._doubt_on_publishers(),
        )
        self._store.update(graph_snapshot.with_setpoint, setpoint)

    def _on_measured(self, message: WellRates) -> None:
        rates = conversions.rates_from_msg(message.wells)
        by_person = message.start == message.header.stamp
        self._store.update(
            graph_snapshot.with_measured, rates, by_person=by_person, clock=time.time()
        )

    def _on_cycle(self, message: CycleReport) -> None:
        point = graph_snapshot.CyclePoint(
            time=conversions.time_from_msg(message.header.stamp),
            prediction_error=message.prediction_error,
            corrected_error=message.corrected_error,
            expected_error=message.expected_error,
            disallowed_tracer=message.disallowed_tracer,
            cycle_duration=conversions.seconds_from_msg(message.cycle_duration),
            objective=message.objective,
            objective_unchanged=message.objective_unchanged,
            corrected=message.corrected,
            correction_status=message.correction_status,
            remarks=tuple(message.remarks),
        )
        self._store.update(graph_snapshot.with_cycle, point)

    def _on_forecast(self, message: Forecast) -> None:
        self._store.update(replace, expected=self._expectation(message))

    def _on_offer(self, message: MendOffer) -> None:
        if not 0.0 <= message.confidence <= 1.0:
            raise InputError(f'its confidence {message.confidence:g} is not from 0 to 1')
        state, is_open = conversions.offer_state_from_msg(message)
        offer = graph_snapshot.MendOffer(
            sequence=message.sequence,
            state=state,
            is_open=is_open,
            time=conversions.time_from_msg(message.header.stamp),
            confidence=message.confidence,
            sentence=message.sentence,
            report=message.report,
        )
        self._store.update(replace, offer=offer)

    def _expectation(self, message: Forecast) -> Expectation:
        """Return a forecast of the siblings with the outlines of the plume at its end.

        Raises:
            InputError: a map or a rate is wrong.
        """
        plan = conversions.plan_from_msg(message.schedule)
        if not plan:
            raise InputError('its schedule is empty')
        rig, observed = self._store.snapshot.rig, self._store.snapshot.observed
        now = observed.map if observed is not None else None
        last = self._map(message.mean[-1]) if message.mean else None
        time_s = conversions.time_from_msg(message.header.stamp)
        return Expectation(
            time=time_s,
            rates=plan[0].rates if rig is None else without_water(plan[0].rates, rig.wells),
            times=np.array([conversions.seconds_from_msg(time) for time in message.times]),
            zone_tracer=np.array(
                [message.zone_tracer_low, message.zone_tracer, message.zone_tracer_high]
            ),
            zone_reached=np.array(message.zone_reached),
            outline_time=last.time - time_s if last is not None else 0.0,
            outlines=plume_outlines(last.concentration, last.grid) if last is not None else (),
            now=plume_outlines(now.concentration, now.grid) if now is not None else (),
            water=in_short(message.water),
        )

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        now = time.monotonic()
        for status in message.status:
            level = LEVELS.get(status.level, graph_snapshot.Level.ERROR)
            values = {item.key: item.value for item in status.values}
            text = in_short(status.message)
            report = graph_snapshot.Health(level, text, now, ended=ENDED in values)
            with suppress(KeyError, ValueError):
                report = replace(report, stale_after_s=float(values[STALE_AFTER]))
            name = status.name.rpartition('/')[2]
            if status.hardware_id != hardware_id(self):
                name = f'{status.hardware_id or "another device"}: {name}'
            self._store.update(graph_snapshot.with_health, in_short(name), report)

    def _update_nodes(self) -> None:
        names = [
            name
            for name, namespace in self.get_node_names_and_namespaces()
            if namespace == self.get_namespace() and not name.startswith('_')
        ]
        self._store.update(graph_snapshot.with_nodes, names, time.monotonic())
        self._store.update(replace, alarm=self._doubt_on_publishers())
        self._store.update(graph_snapshot.with_graph_time, self._graph_time(), time.time())
        self._complaints.look()
        count, workers = self._application.streams, self._application.workers
        if (busy := workers.busy_for) > CALLBACK_PATIENCE_S:
            self._diagnostics.report(
                DiagnosticStatus.ERROR,
                f'all {workers.count} threads of the page are at work for {busy:.0f} s: maps and '
                'confirmations wait; restart the page if this goes on',
            )
            return
        self._diagnostics.report(
            DiagnosticStatus.OK, f'{self._url}, {count} {"browser" if count == 1 else "browsers"}'
        )

    def _doubt_on_publishers(self) -> str:
        publishers = senders.publishers(self, SETPOINT_TOPIC)
        return self._source.doubt([sender.node for sender in publishers], time.monotonic())

    def _ask(self, rates: RatesByWell) -> Expectation:
        """Return the outlook of `rates` of control wells; runs in a thread of the server.

        Raises:
            InputError: the siblings refused the question.
            SiblingsUnavailable: they are absent or do not answer.
        """
        client = self._what_if_client
        if not client.wait_for_service(timeout_sec=LONGEST_SEARCH_S):
            raise SiblingsUnavailable(
                'no forecast: the node siblings, an ensemble of twins, does not run; start it'
            )
        request = WhatIf.Request(proposed=conversions.plan_to_msg([RateStep(0.0, rates)]))
        response = twin_answer_within(self, client, request, ANSWER_TIMEOUT, look=self._go_on)
        if response is None:
            raise SiblingsUnavailable(f'the siblings did not answer within {ANSWER_TIMEOUT:g} s')
        if response.outcome.code != Outcome.OK:
            raise InputError(response.outcome.message)
        return replace(self._expectation(response.proposed), note=response.outcome.message)

    def _answer_offer(self, answer: MendAnswer) -> None:
        """Call the mend node; runs in a thread of the server.

        Raises:
            InputError: the mend node refused the answer.
            ConfirmationUnavailable: the mend node is absent or does not answer.
        """
        client = self._mend_client
        if not client.wait_for_service(timeout_sec=LONGEST_SEARCH_S):
            raise ConfirmationUnavailable('no answer possible: the node mend does not run')
        request = AnswerMend.Request(sequence=answer.sequence, accept=answer.accept)
        response = self._voucher.ask(
            client, 'mend/answer', request, LONGEST_ANSWER_S, look=self._go_on
        )
        if response is None:
            raise ConfirmationUnavailable(
                f'the mend node did not answer within {LONGEST_ANSWER_S:g} s; try again'
            )
        if response.outcome.code != Outcome.OK:
            raise InputError(response.outcome.message)

    def _confirm(self, given: Confirmation) -> str:
        """Call the operator node and return one line; runs in a thread of the server.

        Raises:
            InputError: the operator node refused the confirmation.
            ConfirmationUnavailable: the operator node is absent or does not answer.
        """
        client = self._confirm_client
        if not client.wait_for_service(timeout_sec=LONGEST_SEARCH_S):
            raise ConfirmationUnavailable('no confirmation possible: the operator node is absent')
        timeout, wells = self._confirm_timeout, conversions.rates_to_msg(given.rates)
        request = ConfirmRates.Request(sequence=given.sequence, wells=wells)
        ask = partial(self._voucher.ask, client, 'operator/confirm', request, look=self._go_on)
        response = ask(timeout)
        if given.sure and response is not None and response.outcome.code != Outcome.OK:
            # the operator node takes odd rates that are confirmed once more: this yes
            response = ask(timeout)
        if response is None:
            raise ConfirmationUnavailable(
                f'the operator node did not answer within {timeout:g} s; try again'
            )
        outcome = response.outcome
        if outcome.code != Outcome.OK:
            raise InputError(outcome.message)
        self._store.update(graph_snapshot.with_confirmation, given.sequence, safe=given.safe)
        return f'setpoint {given.sequence} confirmed'

    def _go_on(self) -> None:
        """Return while the page runs; raise ConfirmationUnavailable when it ends."""
        if self._ends:
            raise ConfirmationUnavailable('the page ends; ask the next one')

    def destroy_node(self) -> None:
        """Stop the server, then destroy the node."""
        self._ends = True
        self._server.close()
        self._past.close()
        super().destroy_node()


def main() -> None:
    """Run the node."""
    run(PageNode)


if __name__ == '__main__':
    main()
