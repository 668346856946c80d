"""Findings on one rig, for tests of the history."""

from porotwin_diagnosis.history.past_findings import FoundCause, PastFinding, Value

MONDAY, TUESDAY = '2026-11-23T10:00:00+00:00', '2026-11-24T10:00:00+00:00'


def value(middle, width=0.04):
    return Value(value=middle, low=middle - width / 2, high=middle + width / 2)


def cause(effect, well='', **values):
    return FoundCause(effect=effect, well=well, values=values)


def finding(*causes, date=MONDAY, verdict=None, **others):
    """Return a finding whose causes are all named, unless `named` says otherwise."""
    names = tuple(one.effect for one in causes)
    return PastFinding(
        date=date,
        recordings=others.pop('recordings', (f'/runs/{date}',)),
        rig=others.pop('rig', 'box'),
        verdict=verdict or names[0],
        confidence=others.pop('confidence', 0.97),
        causes=causes,
        named=others.pop('named', names),
        **others,
    )


def pump(factor, date=MONDAY, width=0.04, **others):
    return finding(cause('rate', 'injector', factor=value(factor, width)), date=date, **others)
