"""The rules of mending: when to diagnose, what to offer, and when to remove an effect.

This module knows no messages. Callers report every event and pass functions that act on the graph.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rates.rate_periods import RatePeriod
from porotwin_core.rig import EffectDescription, Rig
from porotwin_diagnosis.mending.finding import Finding
from porotwin_diagnosis.mending.forecast_band import ForecastBand
from porotwin_diagnosis.mending.offer_book import Offer, OfferBook
from porotwin_diagnosis.mending.shadow_forecast import ShadowForecast, ShadowJudgement
from porotwin_solver.model.model import Model
from porotwin_solver.service.effects_in_force import in_words

Effects = tuple[EffectDescription, ...]

LEAST_MAPS = 12
"""Photographs before the first diagnosis: of 8 or fewer it says nothing."""

SHORTEST_S = 300.0
"""Shortest time between two diagnoses for forecasts out of their band [s]: until the plume has
moved, the next one would see the same. It doubles with each such diagnosis until effects change."""

MOST_AGE = 0.5
"""Largest age of a verdict, as a share of the run that it has seen: later it is outdated."""

LEAST_AGE_S = 900.0
"""Age of a verdict that is never too old [s]: the longest diagnosis of a large rig."""


@dataclass(frozen=True)
class MendSettings:
    """The interval of diagnoses, and the least confidence of a verdict.

    `every_s` is the time of the experiment between two diagnoses [s].
    """

    every_s: float
    least_confidence: float


class Mender:
    """Mends one running twin."""

    def __init__(
        self,
        make_model: Callable[[Effects], Model],
        settings: MendSettings,
        *,
        set_effects: Callable[[Effects], None],
        publish: Callable[[Offer], None],
        say: Callable[[str], None],
    ) -> None:
        """Make the mender.

        Args:
            make_model: returns the model of the solver with these effects.
            settings: when and how sure.
            set_effects: lets effects act in the solver; raises InputError if the solver refuses
                them, TimeoutError if it is silent.
            publish: takes every offer that changes.
            say: takes lines for people.
        """
        self._make_model = make_model
        self._settings = settings
        self._set_effects = set_effects
        self._publish = publish
        self._say = say
        self._band = ForecastBand()
        self._book = OfferBook(settings.least_confidence)
        self._in_force: Effects = ()
        self._before: Effects = ()
        self._shadow: ShadowForecast | None = None
        self._began: float | None = None
        self._asked: float | None = None
        self._maps = 0
        self._shortest = SHORTEST_S
        self._lost = False
        self._is_inherited = False
        self._unanswered: Effects | None = None
        self._takes_back = False

    @property
    def in_force(self) -> Effects:
        """The effects that should act in the solver beyond its rig."""
        return self._in_force

    @property
    def waits(self) -> bool:
        """Whether an offer is open."""
        return self._book.open is not None

    @property
    def watches(self) -> bool:
        """Whether photographs still judge an accepted effect."""
        return self._shadow is not None

    @property
    def newest(self) -> Offer | None:
        """The newest offer."""
        return self._book.newest

    # --- when to diagnose ---------------------------------------------------------------------

    def interrupt(self) -> None:
        """Note an interruption: the next photograph does not follow from the last one."""
        if self._shadow is not None:
            self._shadow.interrupt()

    def begin_anew(self) -> None:
        """Note that another experiment begins, with the same rig."""
        self.interrupt()
        self._void('another experiment begins')
        self._band.begin_anew()
        self._began = self._asked = None
        self._maps = 0
        self._shortest = SHORTEST_S

    def occasion(self, stamp: float, error: float, expected: float) -> str:
        """Return the reason for a diagnosis after the photograph at `stamp` [s]; empty for none.

        Args:
            stamp: time of the photograph [s].
            error: relative error of its forecast [-]; NaN without a forecast.
            expected: the expected error [-]; NaN if unknown.
        """
        self._began = stamp if self._began is None else self._began
        self._maps += 1
        left = self._band.left_by(error, expected)
        if self.watches or self._maps < LEAST_MAPS:
            return ''
        since = stamp - (self._began if self._asked is None else self._asked)
        reason = ''
        if since >= self._settings.every_s:
            reason = f'{since / 60.0:.0f} min since the last one, or since the start'
        elif left and (self._asked is None or since >= self._shortest):
            reason = 'the forecasts have left their band'
            self._shortest *= 2.0
            self._band.begin_anew()
        if reason:
            self._asked = stamp
        return reason

    # --- findings and answers -----------------------------------------------------------------

    def found(self, finding: Finding, *, seen: float, now: float, given: Effects) -> None:
        """Offer a finding, or report the reason against an offer.

        Args:
            finding: the verdict.
            seen: time of the last photograph in the diagnosis [s].
            now: time of the newest photograph [s].
            given: the effects in force when the diagnosis began. If they have changed, they may
                contain the finding already.
        """
        if given != self._in_force:
            self._say(
                f'a verdict ({finding.verdict}) is about a model that has changed since; it is not '
                'offered'
            )
            return
        length = seen - (self._began if self._began is not None else seen)
        if self._began is None or now < seen or now - seen > max(LEAST_AGE_S, MOST_AGE * length):
            self._say(
                f'a verdict ({finding.verdict}) is outdated by newer photographs; it is not offered'
            )
            return
        changed, why_not = self._book.consider(finding, seen)
        for offer in changed:
            self._tell(offer)
        if why_not:
            self._say(f'nothing to offer: {why_not}')

    def answer(self, sequence: int, *, accept: bool) -> Offer:
        """Return the offer `sequence` after the answer of the operator.

        Raises:
            InputError: there is no such open offer, or the solver refuses its effects.
            TimeoutError: the solver does not answer; the offer stays open. If the solver tells
                later that the effects act, the offer counts as accepted.
        """
        offer = self._book.check(sequence)
        if not accept:
            return self._tell(self._book.refuse())
        wanted = (*self._in_force, *offer.finding.effects)
        try:
            self._make_model(wanted)
            self._set_effects(wanted)
        except InputError:
            self._tell(self._book.refuse('the solver'))
            raise
        except TimeoutError:
            self._unanswered = wanted
            raise
        return self._accept(wanted)

    def _accept(self, wanted: Effects) -> Offer:
        """Note that the effects `wanted`, with those of the open offer, act in the solver."""
        self._shadow = ShadowForecast(self._make_model(wanted), self._make_model(self._in_force))
        self._before, self._in_force, self._unanswered = self._in_force, wanted, None
        self._is_inherited = self._takes_back = False
        self._shortest = SHORTEST_S
        self._band.begin_anew()
        return self._tell(self._book.accept())

    def _void(self, why: str) -> None:
        """Make an open offer void, because its verdict is about something else."""
        for offer in self._book.expire(why):
            self._tell(offer)
        self._unanswered = None

    def _tell(self, offer: Offer) -> Offer:
        self._publish(offer)
        self._say(offer.sentence)
        return offer

    # --- the photographs after an acceptance --------------------------------------------------

    def see(self, observed: FloatArray, periods: Sequence[RatePeriod]) -> None:
        """Judge the accepted effects by a photograph; remove them if forecasts are worse with them.

        Args:
            observed: its map (nz, nx) [-]; NaN where nothing was seen.
            periods: the rates since the last photograph; empty after an interruption.
        """
        if self._lost:
            self._restore()
        shadow = self._shadow
        if shadow is None:
            return
        try:
            judgement = shadow.see(observed, periods)
        except InputError as error:
            self._say(f'no shadow forecast for this photograph: {error}')
            shadow.interrupt()
            return
        if judgement is ShadowJudgement.WATCHING:
            return
        if self._is_inherited:
            self._shadow = None
            self._say(f'{in_words(self._in_force)}: {judgement.value}; {shadow.in_words}')
        elif judgement is ShadowJudgement.KEPT:
            self._shadow = None
            self._tell(self._book.confirm(f'Since then {shadow.in_words}'))
        else:
            self._take_back(shadow)

    def _take_back(self, shadow: ShadowForecast) -> None:
        try:
            self._set_effects(self._before)
        except (InputError, TimeoutError) as error:
            self._takes_back = isinstance(error, TimeoutError)
            self._say(f'effects not taken back, tried again with the next photograph: {error}')
            return
        self._note_taken_back(shadow)

    def _note_taken_back(self, shadow: ShadowForecast) -> None:
        self._in_force = self._before
        self._shadow = None
        self._takes_back = False
        self._band.begin_anew()
        self._tell(self._book.take_back(shadow.in_words))

    # --- the solver ---------------------------------------------------------------------------

    def solver_tells(self, effects: Effects, *, is_new: bool) -> None:
        """Compare the effects that the solver reports with the accepted effects.

        A restarted solver (`is_new`) has lost the effects and gets them again, if need be with the
        next photographs. Effects from another program count as decided, and an effect under
        judgement is then judged no more. Effects from before this node began are judged and the
        result is told; they stay, because another program may have decided them.
        """
        self._lost = is_new and effects != self._in_force
        if self._lost:
            self._restore()
            return
        if effects == self._in_force:
            return
        if effects == self._unanswered and self.waits:
            self._accept(effects)
            return
        if self._takes_back and self._shadow is not None and effects == self._before:
            self._note_taken_back(self._shadow)  # the answer came too late
            return
        self._void('the effects of the model have changed')
        self._in_force = effects
        self._shadow = None
        self._takes_back = False
        self._band.begin_anew()
        if self._began is None:  # an earlier node, if any, took what it knew with it
            self._shadow = ShadowForecast(self._make_model(effects), self._make_model(()))
            self._is_inherited = True
            self._say(
                f'in force before this node began: {in_words(effects)}; the next photographs '
                'judge it, and nothing is removed'
            )
        else:
            self._say(f'somebody else set: {in_words(effects)}')

    def _restore(self) -> None:
        """Give the solver the effects that it has lost."""
        try:
            self._set_effects(self._in_force)
        except (InputError, TimeoutError) as error:
            self._say(
                'the solver was started again and lacks its effects; they are set with the next '
                f'photograph: {error}'
            )
            return
        self._lost = False
        self._say('the solver was started again; its effects are set again')


def model_maker(rig: Rig, grid: Grid, preset: str) -> Callable[[Effects], Model]:
    """Return a function that makes the model of the solver with effects beyond those of `rig`."""

    def make(effects: Effects) -> Model:
        return Model(rig, grid, preset=preset, effects=effects)

    return make
