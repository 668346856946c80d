"""The first screen of the report: cause, place, size and confidence."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from porotwin_diagnosis.advice.partial_cause import is_dipole
from porotwin_diagnosis.data.error_parts import in_words
from porotwin_diagnosis.data.sample import FRONT_TOLERANCE
from porotwin_diagnosis.decision.compared_readings import ComparedReading
from porotwin_diagnosis.decision.held_out import (
    camera_errors,
    remaining_parts,
    root_mean_square,
)
from porotwin_diagnosis.decision.verdict import NONE, NUMERICAL, UNEXPLAINED
from porotwin_diagnosis.diagnosis import Diagnosis
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.report.doubts import ALWAYS_SAID, doubt_words, scant
from porotwin_diagnosis.report.named_rows import named_rows
from porotwin_diagnosis.report.wording import interval, percent, phrase, spoken, spoken_label
from porotwin_diagnosis.search.ranking import misfit_beyond_noise, swallowed_misfit
from porotwin_diagnosis.thresholds import NO_GAP_MISFIT, OPEN_CONFIDENCE
from porotwin_solver.effects import EFFECTS
from porotwin_solver.effects.definition.words import number

MORE_THAN_NOISE = 1.3
"""Error over the noise floor above which more than noise and blur is left."""

NEARLY_ALL = 0.8
"""Least share of an unexplained gap that nearly explains it, if effects of the library close it."""

NO_FRONTS = 0.5
"""Error of a model from which on it has no fronts near the observed ones [-]."""

NO_GOOD_FORM = 'No form that was found fits well'
"""Said before a form that closes less than half of the gap."""

Summary = Mapping[str, Any]
"""The content of diagnosis.json."""


def answer(result: Diagnosis, summary: Summary) -> list[tuple[str, list[str]]]:
    """Return four rows with their lines: the cause, where it acts, how much, and how sure."""
    return [
        ('Cause', _cause(result, summary)),
        ('Where', _where(result, summary)),
        ('How much', _how_much(result, summary)),
        ('How sure', _how_sure(result, summary)),
    ]


def sentence(result: Diagnosis, summary: Summary) -> str:
    """Return the verdict on `result` in one or two sentences; the **effects** are marked.

    The verdict of a search that was ended is preliminary.
    """
    if result.evidence.findings.untried:
        return f'**Preliminary**: {_sentence(result, summary)}'
    return _sentence(result, summary)


def _sentence(result: Diagnosis, summary: Summary) -> str:
    verdict, errors = result.verdict, summary['error']
    before, floor = percent(errors['before']), percent(errors['noise_floor'])
    sure = f'confidence {100 * verdict.confidence:.0f} %'
    if verdict.name == NONE:
        return _no_gap(result, errors, sure)
    if verdict.name == UNEXPLAINED:
        gap = (
            'There is a gap: the error of the model in the held-out part is '
            f'{before}, but noise and blur of the maps alone make only {floor}'
        )
        if errors['before'] <= errors['noise_floor']:
            gap = (
                'There is a gap at fronts or in single places. In the whole held-out part the '
                f'error is {before}, and noise and blur of the maps may make {floor}'
            )
        return f'**Unexplained** ({sure}). {gap}. {_nothing_explains(result, summary)}.'
    return (
        f'{_named(result, summary)} ({sure}). {_improvement(result, summary)}{_described(result)} '
        f'{_remaining(result)}'
    ).strip()


def _described(result: Diagnosis) -> str:
    """Say which named effects rig.yaml describes already: its values may be wrong instead."""
    known = {effect.name for effect in result.recordings[0].rig.effects}
    again = [spoken(name) for name in result.verdict.members if name in known]
    if not again:
        return ''
    return (
        f' The rig.yaml describes {" and ".join(again)} already, and this comes on top of it: '
        'look there first.'
    )


def _no_gap(result: Diagnosis, errors: Mapping[str, float], sure: str) -> str:
    """Say that there is no gap, and explain the remaining error."""
    before, floor = percent(errors['before']), percent(errors['noise_floor'])
    head = 'No gap' if result.verdict.confidence > OPEN_CONFIDENCE else 'No gap, but this is unsure'
    words = (
        f'**{head}** ({sure}). The model as it is explains {these(result)}: its error in the '
        f'held-out part is {before}, and noise and blur of the maps alone make {floor}.'
    )
    if errors['before'] > MORE_THAN_NOISE * errors['noise_floor']:
        words += (
            ' The rest is no larger than the errors that a solver and a calibration leave, and '
            'shows no effect.'
        )
    return f'{words} {_remaining(result)}'.strip()


def _named(result: Diagnosis, summary: Summary) -> str:
    """Name the effects and their meaning for the rig."""
    verdict = result.verdict
    same = verdict.alternatives or [(name, *verdict.members[1:]) for name in verdict.not_separable]
    names = ' or '.join(map(_together, [verdict.members, *same]))
    means = ', and '.join(meanings(verdict.members, summary))
    for others, together in zip(verdict.alternatives, summary['alternative_effects'], strict=True):
        own = [name for name in others if name not in verdict.members]
        joint = [phrase(row['name'], row['parameters']) for row in together]
        means = f'{means}; or {", and ".join(joint or meanings(own, summary))}'
    if same:
        names += f', which {these(result)} cannot separate'
    if not verdict.alternatives:
        means = ', or '.join([means, *meanings(verdict.not_separable, summary)])
    for name in (*verdict.members, *verdict.not_separable):
        means += f' ({also} makes the same maps)' if (also := EFFECTS[name].also) else ''
    return f'{names[:2]}{names[2:3].upper()}{names[3:]}: {means}'


def _improvement(result: Diagnosis, summary: Summary) -> str:
    """Say how far the error falls with the named effects."""
    errors = summary['error']
    before, after, floor = (percent(errors[key]) for key in ('before', 'after', 'noise_floor'))
    if errors['after'] >= errors['before']:
        return _hidden_improvement(result)
    return (
        f'With the correction the error of the model in the held-out part is {after} instead of '
        f'{before}. Noise and blur of the maps alone make {floor}, so that {closed(errors)} of the '
        'gap is closed.'
    )


def _hidden_improvement(result: Diagnosis) -> str:
    """Say where the error falls, if the plain error of the held-out part does not."""
    seen_before, seen_after = camera_errors(result.held_out)
    before = result.evidence.findings.null.fitted_error
    after = result.verdict.model.fitted_error
    if seen_after >= seen_before and result.readings and after >= before:
        off = [root_mean_square(one) for one in zip(*map(_off, result.readings), strict=True)]
        return (
            'The maps are the same with and without the correction. The readings beside them lie '
            f'{number(off[1], 2)} instead of {number(off[0], 2)} standard deviations off.'
        )
    if seen_after >= seen_before:
        return (
            f'The gap lies in the part before the held-out one: there the error is '
            f'{percent(after)} with the correction instead of {percent(before)}. In the held-out '
            f'part it is {percent(seen_after)} instead of {percent(seen_before)}.'
        )
    level = '' if result.held_out[0].level_known else ' and the level of these maps'
    return (
        f'With the correction, and with the blur of the camera{level}, the error of the model in '
        f'the held-out part is {percent(seen_after)} instead of {percent(seen_before)}.'
    )


def _off(one: ComparedReading) -> tuple[float, float]:
    """Return how far a reading lies off the model before and after [standard deviations]."""
    read = one.reading
    return (read.value - one.before) / read.deviation, (read.value - one.after) / read.deviation


def _nothing_explains(result: Diagnosis, summary: Summary) -> str:
    """Say which effects were tried, and the error that remains with the best of them."""
    findings, errors = result.evidence.findings, summary['error']
    beside = summary['remainder'] and summary['remainder']['beside']
    form = result.remainder
    if beside and form is not None and form.terms and form.closed > _closed_share(beside):
        said = ', and '.join(term.words for term in form.terms)
        looks = 'It looks as if' if form.fits_well else f'{NO_GOOD_FORM}. The best one is that'
        return (
            f'{looks} {said}. This closes {100 * form.closed:.0f} % of it. It was '
            'found by regression, so it is only a hint'
        )
    if beside:
        return (
            f'The nearest explanation, that {_means(beside)}, closes '
            f'{100 * _closed_share(beside):.0f} % of it. The rest is more than noise and solver '
            'leave, so that another cause may be at work'
        )
    tried = len({fit.members[0].effect for fit in findings.screened})
    pairs = ', and none of their best combinations,' if findings.pairs else ''
    best, after = label(result.verdict.model), percent(errors['after'])
    remaining = ''
    if errors['after'] < NO_FRONTS:
        remaining = f', as if fronts were {misplaced_fronts(result, result.verdict.model)} off'
    if errors['after'] < errors['before']:
        with_best = (
            f'With {best}, which fits the fronts best, the error is still {after}{remaining}'
        )
    else:
        with_best = (
            f'{best.capitalize()} fits the fronts best, but with it the error in the '
            f'held-out part is {after}{remaining}'
        )
    return f'None of the {tried} tried effects{pairs} explains it. {with_best}'


def misplaced_fronts(result: Diagnosis, fit: Fit) -> str:
    """Return the shift of fronts, in mm, that would make the misfit of `fit` beyond the noise."""
    shift = max(misfit_beyond_noise(fit)) * FRONT_TOLERANCE * result.samples[0].grid.dx
    return f'{number(1e3 * shift, 2)} mm'


def _cause(result: Diagnosis, summary: Summary) -> list[str]:
    """Name the effects, and say whether each is one of the rig, the camera or the model."""
    verdict = result.verdict
    if verdict.name == NONE:
        return ['None is needed.']
    if verdict.name == UNEXPLAINED:
        share, part = _part(result, summary)
        form = [] if share > _closed_by_form(result) else [_form(result)]
        head = 'Not sure: the library explains nearly all of it, but not all.'
        if share <= NEARLY_ALL:
            head = 'Not in the library of effects.'
        return [head, *form, *filter(None, [part])]
    lines = [_with_origin(name) for name in verdict.members]
    if not verdict.alternatives:
        lines += [f'or {_with_origin(name)}' for name in verdict.not_separable]
    lines += [f'or {_together(names)} together' for names in verdict.alternatives]
    return lines


def _form(result: Diagnosis) -> str:
    """Describe the remainder."""
    form = result.remainder
    if form is None or not form.terms:
        return 'No simple form describes what is missing either.'
    said = ', and '.join(term.words for term in form.terms)
    kind = {
        'source': 'a source or sink of water',
        'transport': 'the transport in the sand',
        'storage': 'the storage of tracer in the sand',
        'camera': 'the camera',
    }[form.terms[0].kind]
    looks = 'It looks most like' if form.fits_well else f'{NO_GOOD_FORM}. The best one looks like'
    return (
        f'{looks} {kind}: {said}. This form, found by regression, closes '
        f'{100 * form.closed:.0f} % of the gap in the held-out part. It is a hint; '
        'docs/reliability.md says how often the kind is right. Thin tight walls were not '
        'recognised.'
    )


def _closed_by_form(result: Diagnosis) -> float:
    return result.remainder.closed if result.remainder and result.remainder.terms else 0.0


def _part(result: Diagnosis, summary: Summary) -> tuple[float, str]:
    """Return the share that known effects close of an unexplained gap, and say which they are."""
    beside = summary['remainder'] and summary['remainder']['beside']
    if not beside:
        return 0.0, ''
    together = ' together' if len(beside['effects']) > 1 else ''
    partial, rest, place = result.partial, [], beside['place']
    if place:
        rest.append(f'arises most of all near x = {place["x_m"]:.2f} m, z = {place["z_m"]:.2f} m')
    if beside['terms']:
        words = ', and '.join(term['words'] for term in beside['terms'])
        roughly = '' if partial is None or partial.form.fits_well else ', though not well,'
        rest.append(f'looks{roughly} like this: {words}')
    remains = f' What remains beside that {" and ".join(rest)}.' if rest else ''
    if partial and is_dipole(partial.model.effects, result.samples[0].grid.width):
        remains = (
            ' A source beside an equally strong sink acts like a patch of sand that conducts '
            f'better or worse than its surroundings.{remains}'
        )
    closed_share = _closed_share(beside)
    return closed_share, (
        f'A part of it may be: {_means(beside)}. That{together} closes '
        f'{100 * closed_share:.0f} % of the gap.{remains}'
    )


def _means(beside: Mapping[str, Any]) -> str:
    """Return the meaning of the effects `beside` an unexplained remainder."""
    return ', and '.join(phrase(row['name'], row['parameters']) for row in beside['effects'])


def _closed_share(beside: Mapping[str, Any]) -> float:
    """Return the share of the gap that the effects `beside` the remainder close, at most 1."""
    return float(min(beside['gap_closed'], 1.0))


def _with_origin(name: str) -> str:
    return f'**{spoken(name)}**, an effect of the {origin(name)}'


def origin(name: str) -> str:
    """Return whether the effect `name` belongs to the camera, to the model or to the rig."""
    if name == NUMERICAL:
        return 'model'
    return 'camera' if EFFECTS[name].is_of_camera else 'rig'


def _where(result: Diagnosis, summary: Summary) -> list[str]:
    """Say where the named effects act, and those that look the same."""
    verdict = result.verdict
    if verdict.name == NONE:
        return ['Nowhere.']
    if verdict.name == UNEXPLAINED:
        return [_hot_spots(result)]
    same = () if verdict.alternatives else verdict.not_separable
    names = (*verdict.members, *same)
    places = _places_of(names, result, summary)
    if len(set(places)) == 1:
        return places[:1]
    lines = zip(names, places, strict=True)
    return [f'{spoken(name)}: {place}' for name, place in lines]


def _places_of(names: Sequence[str], result: Diagnosis, summary: Summary) -> list[str]:
    rows = named_rows(summary, names)
    return [_place_of(name, row, result) for name, row in zip(names, rows, strict=True)]


def _place_of(name: str, row: Mapping[str, Any], result: Diagnosis) -> str:
    if EFFECTS[name].is_of_camera:
        return (
            'Nowhere in the rig: this is an effect of the camera. “Where it arises” means nothing '
            'here; the map of one-step errors shows only which fronts the camera changes.'
        )
    if name == NUMERICAL:
        return 'In the model, at every front.'
    values = {key: entry['value'] for key, entry in row['parameters'].items()}
    if EFFECTS[name].has_place:
        return f'At x = {values["x"]:.3f} m, z = {values["z"]:.3f} m.'
    if 'well' in values:
        well = result.recordings[0].rig.wells[values['well']]
        place = f'At the well {values["well"]}, x = {well.x_m:.3f} m, z = {well.z_m:.3f} m'
        if not {'dx', 'dz'} <= values.keys():
            return f'{place}.'
        x, z = well.x_m + values['dx'], well.z_m + values['dz']
        return f'{place} by rig.yaml; it opens at x = {x:.3f} m, z = {z:.3f} m.'
    return 'In the whole rig.'


def _hot_spots(result: Diagnosis) -> str:
    if not result.gap.spots:
        return 'Everywhere: no place stands out.'
    spot = result.gap.spots[0]
    seen = ' The camera is no part of the rig: this is only where its effect shows.'
    of_camera = result.remainder is not None and result.remainder.kind == 'camera'
    return (
        f'Most of all near x = {spot.x:.2f} m, z = {spot.z:.2f} m: {100 * spot.share:.0f} % of the '
        f'gap arises within {1e3 * spot.radius:.0f} mm.{seen if of_camera else ""}'
    )


def _how_much(result: Diagnosis, summary: Summary) -> list[str]:
    """List the parameters with their intervals, and the errors.

    Inseparable effects are listed too, but not for a pair: they were fitted alone.
    """
    verdict, errors = result.verdict, summary['error']
    named = verdict.members
    if len(named) == 1:
        named = (*named, *verdict.not_separable)
    rows = [row for row in summary['effects'] if row['name'] in named]
    lines = [
        f'{spoken(row["name"])}, {line}' if len(rows) > 1 else line
        for row in rows
        for line in _parameters(row)
    ]
    before, after, floor = (percent(errors[key]) for key in ('before', 'after', 'noise_floor'))
    improved = f'; {after} with the correction' if verdict.kept else ''
    lines.append(f'Error in the held-out part: {before}{improved}; {floor} from noise and blur.')
    return [*lines, *filter(None, [_remaining(result)])]


def _remaining(result: Diagnosis) -> str:
    """Name the parts of the error that remains; empty where they were not measured."""
    parts = remaining_parts(result.held_out)
    return f'The remaining error: {in_words(parts)}.' if parts else ''


def _parameters(row: Mapping[str, Any]) -> Iterable[str]:
    """Yield every fitted parameter of a row of diagnosis.json with its 90 % interval."""
    for name, parameter in row['parameters'].items():
        may_be_fixed = EFFECTS[row['name']].parameters[name].may_be_fixed
        if may_be_fixed and parameter['low'] is None:
            continue
        middle, span = interval(row['name'], name, parameter)
        known = f' (90 % interval {span})' if span else ''
        yield f'{spoken(name)}: **{middle}**{known}'


def _how_sure(result: Diagnosis, summary: Summary) -> list[str]:
    verdict, evidence = result.verdict, result.evidence
    several = verdict.inseparable or verdict.alternatives
    right = 'one of these answers is right' if several else 'this answer is right'
    lines = [
        f'**{100 * verdict.confidence:.0f} %**: the estimated probability that {right}. The '
        'rules for it were set on simulated rigs.'
    ]
    if verdict.doubt not in ALWAYS_SAID:
        lines.append(f'The least certain point: {doubt_words(result)}.')
    if summary['belief']:
        share = max(summary['belief'].values())
        believed = [spoken(name) for name, one in summary['belief'].items() if one > 0.99 * share]
        each = ' each' if len(believed) > 1 else ''
        lines.append(
            'Earlier recordings of this rig count too. They found: '
            f'**{" or ".join(believed)}** ({100 * share:.0f} %{each}).'
        )
    lines += summary['history']
    if verdict.name == UNEXPLAINED:
        lines.append('It is the probability that no effect of the library explains the gap.')
    if verdict.name == NONE and _is_calibrated(result):
        lines.append(
            'The maps were calibrated by an injection. An effect that changed this injection too, '
            'such as a bent response of the dye, may be hidden by the calibration; known dilutions '
            'and the weighed outflow would show it.'
        )
    paling = [name for name in verdict.members if name in EFFECTS and EFFECTS[name].pales_core]
    if paling and _is_calibrated(result):
        names = ' and '.join(map(spoken, paling))
        lines.append(
            f'The size of {names} is a lower bound: the calibration took the core of a plume in '
            'the same rig for stock, and so took a part of the effect out of the maps.'
        )
    swallowed = swallowed_misfit(verdict.model)
    if verdict.name != UNEXPLAINED and swallowed > NO_GAP_MISFIT:
        reason = (
            'The calibration of the maps allows'
            if _is_calibrated(result)
            else 'These maps are not calibrated, which allows'
        )
        lines.append(
            f'{reason} errors that all maps share: scale, bend of the response, place, blur. These '
            f'errors explain a misfit of {swallowed:.2g} between maps and model (1 is the size of '
            f'the noise). Above {NO_GAP_MISFIT} a misfit counts as a gap. So an effect may look '
            'like these errors and stay unseen. Photographs of known dilutions would show it.'
        )
    if verdict.not_separable:
        names = ' or '.join(f'**{spoken(name)}**' for name in verdict.not_separable)
        lines.append(
            f'{these(result).capitalize()} cannot separate **{spoken(verdict.name)}** from '
            f'{names}; see “Next experiment”.'
        )
    if verdict.close:
        named = ' or '.join(map(spoken, (verdict.name, *verdict.inseparable)))
        lines.append(
            f'The probability is that of {named} alone. '
            f'{" and ".join(map(spoken, verdict.close)).capitalize()} would make other maps, but '
            'the errors of these maps hide the difference.'
        )
    if evidence.scant:
        lines.append(
            f'No answer gets more than {100 * OPEN_CONFIDENCE:.0f} % here: {scant(evidence)}.'
        )
    return lines


def _is_calibrated(result: Diagnosis) -> bool:
    """Return whether a recording has maps from photographs, with a calibration."""
    stored = [recording.maps for recording in result.recordings]
    return any(maps is not None and bool(maps.origin.calibrated) for maps in stored)


def these(result: Diagnosis) -> str:
    """Return `this recording` or `these recordings`."""
    return 'this recording' if len(result.recordings) == 1 else 'these recordings'


def meanings(names: Sequence[str], summary: Summary) -> list[str]:
    """Return the meanings of the effects `names` with their fitted parameters, in words."""
    return [phrase(row['name'], row['parameters']) for row in named_rows(summary, names)]


def label(fit: Fit) -> str:
    """Return the effects of `fit` in words."""
    return spoken_label(fit.label)


def closed(errors: Mapping[str, float]) -> str:
    """Return the share of the gap that closes, with its interval."""
    ends = ('gap_closed', 'gap_closed_low', 'gap_closed_high')
    middle, low, high = (100 * min(max(0.0, errors[end]), 1.0) for end in ends)
    return f'{middle:.0f} % ({low:.0f} … {high:.0f} %)'


def _together(names: Iterable[str]) -> str:
    return ' and '.join(f'**{spoken(name)}**' for name in names)
