"""The operator's book of setpoints: which were announced, which expired, what may be confirmed."""

from porotwin_core.errors import InputError
from porotwin_core.wells import WellRate, WellRates
from porotwin_hub.announcement import Announcement, announce, announce_expiry
from porotwin_hub.setpoint_expiry import ExpiryWatch
from porotwin_hub.setpoint_limits import Limits

REMEMBERED_SETPOINTS = 100
"""Setpoints that can still be confirmed: 50 minutes of photographs every 30 s."""


class SetpointBook:
    """All announced setpoints; times [s] are by a clock that nobody sets."""

    def __init__(self, wells: tuple[str, ...], limits: Limits | None) -> None:
        """Begin an empty book.

        Args:
            wells: all wells of the rig.
            limits: of the rates; None: the rig has no control section.
        """
        self._wells = wells
        self._limits = limits
        self._announced: dict[int, dict[str, WellRate]] = {}
        self._newest: dict[str, WellRate] = {}
        self._expiry = ExpiryWatch()

    @property
    def sequences(self) -> tuple[int, ...]:
        """Numbers of the setpoints that can be confirmed, the oldest first."""
        return tuple(self._announced)

    def check(self, rates: WellRates) -> None:
        """Return if `rates` keep the limits of the rig.

        Raises:
            InputError: they break a limit; the message names all of them.
        """
        broken = self._limits.violations(rates) if self._limits is not None else []
        if broken:
            raise InputError('; '.join(broken))

    def announce(
        self, sequence: int, rates: dict[str, WellRate], *, validity: float, now: float
    ) -> Announcement:
        """Add setpoint `sequence`, valid for `validity` [s], and return it in words.

        A number that is not above all others means that the hub was restarted and counts from one.

        Raises:
            InputError: the rates break a limit.
        """
        self.check(rates)
        if sequence <= max(self._announced, default=0):
            self._announced.clear()
        self._announced[sequence] = rates
        while len(self._announced) > REMEMBERED_SETPOINTS:
            del self._announced[next(iter(self._announced))]
        self._expiry.start(sequence, now=now, validity=validity)
        words = announce(sequence, rates, self._newest)
        self._newest = rates
        return words

    def expire(self, now: float) -> Announcement | None:
        """Return the words for a setpoint that has expired by `now`, once; else None.

        From then on its number stands for the safe rates.
        """
        sequence = self._expiry.expired(now)
        if sequence is None:
            return None
        safe = self._limits.safe() if self._limits is not None else {}
        words = announce_expiry(sequence, safe, self._newest)
        if safe:
            self._announced[sequence] = self._newest = safe
        return words

    def confirmed(self, sequence: int, changed: WellRates) -> dict[str, WellRate]:
        """Return the rates that the operator set: as announced, except for the `changed` wells.

        Raises:
            InputError: the setpoint or a well is not known.
        """
        if sequence not in self._announced:
            newest = max(self._announced, default=None)
            known = 'there was none yet' if newest is None else f'the newest is {newest}'
            raise InputError(f'setpoint {sequence} is not known; {known}')
        for well in changed:
            if well not in self._wells:
                raise InputError(
                    f"well '{well}' is not in the rig; known: {', '.join(self._wells)}"
                )
        return {**self._announced[sequence], **changed}
