"""The operator's book: the newest setpoint, its expiry, and its confirmation."""

import math
from dataclasses import dataclass

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.announced_rates import safe_rates_at
from porotwin_core.rates.rate_periods import different_wells, same_by_hand
from porotwin_core.rates.told_rates import doubts_about, other_fluids, refuse_impossible
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_core.rig import Rig
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.operator.announcement import Announcement, announce, announce_expiry, clock_time
from porotwin_hub.operator.setpoint_expiry import ExpiryWatch


@dataclass(frozen=True)
class ShownSetpoint:
    """A setpoint for the operator: rates [m^3/s], and stamps [s] by the clock of the photographs.

    `validity` [s] is the rest of it on arrival. `reason` tells why these rates, in one line.
    """

    sequence: int
    rates: dict[str, WellRate]
    stamp: float
    valid_until: float
    validity: float
    reason: str = ''


class SetpointBook:
    """The newest setpoint and the rates at the pumps; times `now` [s]: by a clock nobody sets."""

    def __init__(self, rig: Rig) -> None:
        """Begin an empty book for `rig`."""
        self._rig = rig
        self._limits = Limits.of(rig) if rig.control is not None else None
        self.began: float | None = None
        """Start of the experiment by the clock of the photographs [s]; None: nobody told it."""
        self.ahead = 0.0
        """How far the clock of the photographs is ahead of the one of the book [s]."""
        self._newest: tuple[int, dict[str, WellRate]] | None = None
        """Number and rates of the setpoint that was announced last."""
        self._at_pumps: dict[str, WellRate] = {}
        """Rates that the operator was told to set, or told to have set otherwise: a well keeps its
        rate until a change is told."""
        self._in_force: ShownSetpoint | None = None
        self._since = -math.inf
        """Arrival of the setpoint in force [s]."""
        self._expiry = ExpiryWatch()
        self._asked: tuple[int, dict[str, WellRate]] | None = None
        """A confirmation that was answered with a question."""

    @property
    def newest(self) -> int | None:
        """Number of the setpoint that can be confirmed; None before the first one."""
        return None if self._newest is None else self._newest[0]

    def check(self, setpoint: ShownSetpoint) -> None:
        """Return if a setpoint keeps the limits of the rig and has not expired.

        Raises:
            InputError: it breaks a limit, and the message names all of them; or it has expired.
        """
        broken = self._limits.violations(setpoint.rates) if self._limits is not None else []
        if broken:
            raise InputError('; '.join(broken))
        if not setpoint.validity > 0.0:
            raise InputError(f'it expired at {clock_time(setpoint.valid_until)}')

    def announce(self, setpoint: ShownSetpoint, *, now: float) -> Announcement:
        """Add a setpoint and return it in words.

        Raises:
            InputError: the rates break a limit, the setpoint has expired, or it follows from an
                older photograph than the one in force.
        """
        self.check(setpoint)
        last = self._in_force
        if last is not None and now >= self._since and setpoint.stamp <= last.stamp:
            raise InputError(
                f'its photograph is no newer than the one of setpoint {last.sequence}, '
                'which is in force'
            )
        self._newest = (setpoint.sequence, setpoint.rates)
        self._in_force, self._since = setpoint, now
        self.ahead = setpoint.valid_until - setpoint.validity - now
        self._expiry.start(setpoint.sequence, now=now, validity=setpoint.validity)
        words = announce(
            setpoint.sequence,
            setpoint.rates,
            self._at_pumps,
            note=(
                f' (photograph {clock_time(setpoint.stamp)}, '
                f'valid until {clock_time(setpoint.valid_until)})'
            ),
            reason=setpoint.reason,
            same=same_by_hand(self._rig),
        )
        self._at_pumps = {
            **self._at_pumps,
            **{well: setpoint.rates[well] for well in words.changed},
        }
        return words

    def expire(self, now: float) -> Announcement | None:
        """Return the words for a setpoint that has expired by `now`, once; else None.

        From then on its number stands for the safe rates. They are told again when an announced
        pause changes them.
        """
        expired, last = self._expiry.expired(now), self._in_force
        safe = self._safe(now)
        if expired is not None and last is not None:
            sequence, note = expired, f' at {clock_time(last.valid_until)}'
        elif last is None and self._newest and safe and different_wells(safe, self._newest[1]):
            sequence, note = self._newest[0], ''
        else:
            return None
        self._in_force = None
        words = announce_expiry(sequence, safe, self._at_pumps, note=note, pause=last is None)
        if safe:
            self._newest, self._at_pumps = (sequence, safe), safe
        return words

    def _safe(self, now: float) -> dict[str, WellRate]:
        """Return the safe rates at `now`, with the announced pauses; empty without control."""
        if self._limits is None:
            return {}
        elapsed = None if self.began is None else now + self.ahead - self.began
        return dict(safe_rates_at(self._rig, elapsed))

    def confirmed(self, sequence: int, changed: WellRates) -> dict[str, WellRate]:
        """Return the rates that the operator set: as announced, except for the `changed` wells.

        Raises:
            InputError: the setpoint is not the newest, a well is not known, a rate is not
                plausible, or a fluid is another. So are odd rates, and safe rates in place of an
                expired setpoint without a word of them, unless the same was said before.
        """
        if self._newest is None:
            raise InputError(f'setpoint {sequence} is not known; there was none yet')
        newest, announced = self._newest
        if sequence != newest:
            raise InputError(
                f'setpoint {sequence} is not the newest; set and confirm setpoint {newest}'
            )
        refuse_impossible(changed, self._rig)
        for well, fluid in other_fluids(changed, self._rig).items():
            raise InputError(
                f"well '{well}' injects concentration {fluid:g} by rig.yaml, "
                f'not {changed[well].concentration:g}'
            )
        rates = {**announced, **changed}
        question = ' '.join(doubts_about(rates, self._rig))
        if question:
            question += ' Correct the rates, or confirm the same once more.'
        if self._in_force is None and not changed:  # whoever confirms may mean what has expired
            question = (
                f'setpoint {sequence} has expired, and the safe rates took its place; confirm once '
                'more if these are set'
            )
        if question and self._asked != (sequence, rates):
            self._asked = (sequence, rates)
            raise InputError(question)
        self._asked = None
        self._at_pumps = {**self._at_pumps, **changed}
        return rates
