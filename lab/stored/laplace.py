"""A prototype of a diagnosis by one model of the errors, beside the present one.

    nice -n 15 python -m lab.stored.laplace FOLDER

Every set of effects that the search judged gets a Laplace approximation of its evidence. Let r be
its whitened residual (n,), and A = (J P, B) the slopes of its parameters and the modes of the
shared errors, each times its prior deviation (`effect_sets`). The amplitudes of A are normal with
deviation 1 about m. Each of the n / t independent errors has the variance v, where t cells of a map
and some frames share one:

    log E(v) = -n / 2t log v - r.r / 2tv - log det(I + G) / 2 + h (I + G)^-1 h / 2 - m.m / 2,
    G = A^T A / tv,  h = A^T r / tv + m

(MacKay, Information Theory, section 28.1). The variance has an inverse gamma prior about what the
noise leaves, and is integrated out. Every set has random fields beside its modes, since no model is
exact; their amplitude and length are integrated out too. `SMALL` ones are errors of the
model. *Something else* is a set with larger ones, `OUTSIDE` as probable as a class of the library.
The classes (none, one effect, several) are as probable as each other, and so are their sets. A
power tempers the probabilities. It and the frames that share an error are fitted.
"""

import argparse
import math
import pickle
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.special import gammaln, logsumexp

from lab.blind.blind_cases import BlindCase
from lab.blind.blind_table import SURE, expected_error, is_sure_and_wrong
from lab.blind.simulation_store import SimulationStore
from lab.stored.ablation import PRESENT, REMEMBERED, ChangedDiagnosis
from lab.stored.linear_sets import (
    WAVES,
    LinearRecording,
    LinearSet,
    recording_of,
)
from lab.stored.stored_cases import FINDINGS, SETS, StoredVerdict, is_held_out, stored_jobs
from porotwin_cli.terminal import print_table
from porotwin_core.geometry.grid import FloatArray
from porotwin_diagnosis.decision.evidence import Evidence
from porotwin_diagnosis.decision.explanation import explain
from porotwin_diagnosis.decision.verdict import NONE, UNEXPLAINED, Verdict
from porotwin_diagnosis.decision.verdict_rules import decide
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.report.evidence_json import read_evidence
from porotwin_diagnosis.thresholds import SYSTEMATIC_MISFIT

SHAPE = 10.0
"""Shape of the inverse gamma prior of the variance: it is known to about a third."""

VARIANCES = np.geomspace(0.01, 30.0, 81)
"""Variances over which the evidence is integrated."""

SMALL, LARGE, LENGTHS = (0.0, 0.003, 0.01), (0.03, 0.1, 0.3, 1.0, 3.0), (0.0, 0.3)
"""Amplitudes of the random fields as errors of the model and as something else, and their
correlation lengths [sides of the rig]."""

FRAMES, TEMPERS = (1.0, 2.0, 4.0, 8.0), np.geomspace(0.01, 1.0, 41)
"""Frames that share an error, and powers of the probabilities, that are tried."""

OUTSIDE = 0.02
"""Prior odds of something else against the library: one recording of fifty has a cause that nobody
wrote down. At even odds an effect that is weak lost its first place to something else in six of 27
recordings."""

LISTED = 1.0 / 3.0
"""Share of the largest probability from which another set is listed beside the first."""


class SetEvidence(NamedTuple):
    """The names of a set, its log evidence with small errors, and with something else beside it."""

    names: tuple[str, ...]
    alone: float
    beside: float


def log_evidence(
    one: LinearSet, scale: FloatArray | float, *, cells: float, correlated: float, variance: float
) -> float:
    """Return the log evidence of the set `one` with its amplitudes times `scale` (k,).

    Args:
        one: a set.
        scale: factors on the deviations of the amplitudes.
        cells: number n of cells.
        correlated: cells t that share an independent error.
        variance: prior mean of the variance of an error [-].
    """
    return float(logsumexp(_by_variance(one, scale, cells, correlated, variance)))


def _by_variance(
    one: LinearSet, scale: FloatArray | float, cells: float, correlated: float, variance: float
) -> FloatArray:
    """Return the log evidence of `one` at each of `VARIANCES`, with the prior of a step there."""
    factor = np.broadcast_to(scale, one.mean.shape)
    values, vectors = np.linalg.eigh(factor[:, None] * one.gram * factor)
    moments, mean = vectors.T @ (factor * one.moments), vectors.T @ one.mean
    k = correlated * VARIANCES[:, None]
    inner = 1.0 + np.maximum(values, 0.0) / k
    logs = -0.5 * (cells / correlated) * np.log(VARIANCES) - 0.5 * one.square / k[:, 0]
    logs += 0.5 * np.sum((moments / k + mean) ** 2 / inner - np.log(inner), axis=1)
    rate = (SHAPE - 1.0) * variance
    prior = SHAPE * np.log(rate / VARIANCES) - gammaln(SHAPE) - rate / VARIANCES
    step = np.log(VARIANCES[1] / VARIANCES[0])
    return np.asarray(logs + prior + np.log(step) - 0.5 * mean @ mean)


def evidences(recording: LinearRecording, frames: float) -> list[SetEvidence]:
    """Return the evidence of every set, if so many `frames` share an error."""
    numbers = numbers_of(recording, frames)
    return [set_evidence(one, recording.fields, numbers) for one in recording.sets]


def numbers_of(recording: LinearRecording, frames: float) -> dict[str, float]:
    """Return the numbers of a recording that `log_evidence` takes."""
    return {
        'cells': float(recording.cells),
        'correlated': recording.correlated * frames,
        'variance': recording.noise + SYSTEMATIC_MISFIT**2,
    }


def set_evidence(one: LinearSet, fields: int, numbers: Mapping[str, float]) -> SetEvidence:
    """Return the evidence of a set whose last `fields` amplitudes are those of something else.

    `numbers` are the named arguments of `log_evidence`.
    """
    size = len(one.mean) - fields

    def mean(amplitudes: Sequence[float]) -> float:
        logs = [
            log_evidence(one, np.append(np.ones(size), amplitude * spectrum_of(length)), **numbers)
            for length, amplitude in product(LENGTHS, amplitudes)
        ]
        return float(logsumexp(logs) - np.log(len(logs)))

    return SetEvidence(one.names, mean(SMALL), mean(LARGE))


def spectrum_of(length: float) -> FloatArray:
    """Return the deviations of the modes of fields of a correlation `length`, mean square 1/f."""
    waves = np.stack(np.meshgrid(*map(np.arange, WAVES), indexing='ij')).reshape(3, -1)
    decay = np.exp(-0.25 * (np.pi * length) ** 2 * np.sum(waves**2, axis=0))
    return np.tile(decay / np.linalg.norm(decay), 4)


def posterior(
    sets: Sequence[SetEvidence], singles: int, temper: float, unknown: Collection[str] = ()
) -> dict[tuple[str, ...], float]:
    """Return the probability of every set by the names of its effects, the largest first.

    Args:
        sets: the sets, the one without effects among them.
        singles: number of single effects that the search tried.
        temper: power of all probabilities.
        unknown: effects that are left out.
    """
    logs: dict[tuple[str, ...], float] = {}
    beside = []
    for one in sets:
        if {*one.names} & {*unknown}:
            continue
        count = len(one.names)
        prior = math.lgamma(count + 1.0) - count * math.log(singles)
        names = tuple(sorted(one.names)) or (NONE,)
        logs[names] = max(one.alone + prior, logs.get(names, -math.inf))
        if count < 2:
            beside.append(one.beside + prior)
    logs[(UNEXPLAINED,)] = float(logsumexp(beside)) + math.log(OUTSIDE)
    scaled = temper * np.array([*logs.values()])
    shares = np.exp(scaled - logsumexp(scaled))
    found = dict(zip(logs, map(float, shares), strict=True))
    return dict(sorted(found.items(), key=lambda pair: -pair[1]))


class StatedSets(NamedTuple):
    """An answer beside the truth: the names that come first, and those listed beside them.

    `right` are the names that are right, `effects` the number of true effects.
    """

    first: tuple[str, ...]
    listed: tuple[str, ...]
    confidence: float
    right: Collection[str]
    effects: int

    @property
    def is_right(self) -> bool:
        """Whether a first or a listed name is right."""
        return not {*self.first, *self.listed}.isdisjoint(self.right)

    @property
    def is_whole(self) -> bool:
        """Whether the first names are as many as there are effects, and all are right."""
        return len(self.first) == max(1, self.effects) and {*self.first} <= {*self.right}

    @property
    def is_sure_and_wrong(self) -> bool:
        """Whether a name is stated with confidence, and no name is right."""
        (name, *_) = self.first
        return is_sure_and_wrong(name, self.confidence, confirmed=self.is_right)

    @property
    def is_sure_of_a_wrong_name(self) -> bool:
        """Whether the first names are stated with confidence, and one of them is wrong."""
        return self.confidence >= SURE and not {*self.first} <= {*self.right}


def judged(
    right: Collection[str], effects: int, found: Mapping[tuple[str, ...], float]
) -> StatedSets:
    """Return the most probable set with those that are nearly as probable.

    `right` and `effects` are those of `StatedSets`.
    """
    (first, most), *_ = found.items()
    sets = [names for names, value in found.items() if value >= LISTED * most]
    listed = tuple(name for names in sets for name in names)
    return StatedSets(first, listed, min(1.0, sum(found[names] for names in sets)), right, effects)


class Question(NamedTuple):
    """A stored recording, or the same with its true effect left out of the library."""

    truth: StoredVerdict
    rules: Verdict
    sets: Mapping[float, Sequence[SetEvidence]]
    singles: int
    part: str
    unknown: tuple[str, ...] = ()

    @property
    def right(self) -> tuple[str, ...]:
        """The names that are right."""
        return (UNEXPLAINED,) if self.unknown else self.truth.right

    def posterior(self, frames: float, temper: float) -> dict[tuple[str, ...], float]:
        """Return the probability of every set, with these two numbers."""
        return posterior(self.sets[frames], self.singles, temper, self.unknown)

    @property
    def effects(self) -> int:
        """The number of true effects that the library has."""
        return 0 if self.right == (UNEXPLAINED,) else len(self.truth.truth)

    def answer(self, frames: float, temper: float) -> StatedSets:
        """Return the verdict of the evidence with these two numbers."""
        return judged(self.right, self.effects, self.posterior(frames, temper))

    def by_rules(self) -> StatedSets:
        """Return the verdict of the rules."""
        one = self.rules
        return StatedSets(
            one.members or (one.name,), one.not_separable, one.confidence, self.right, self.effects
        )

    def log_score(self, frames: float, temper: float) -> float:
        """Return the log probability of the right sets."""
        found = self.posterior(frames, temper)
        right = sum(value for names, value in found.items() if {*names} & {*self.right})
        return math.log(max(right, 1e-6))


PARTS = ('chosen by', 'held out', 'photographs')
"""Parts of the recordings; both numbers are chosen by the first."""


def questions(folder: Path, seed: int, *, photographs: bool = False) -> Iterator[Question]:
    """Yield the questions of the stored recordings in `folder`, from their stored sets."""
    diagnosis = ChangedDiagnosis(PRESENT, {})
    count = max((int(path.name[-3:]) for path in folder.glob('case_*')), default=-1) + 1
    for job in stored_jobs(folder, count, seed, photographs=photographs):
        if not job.file.exists():
            continue
        file = job.file.with_name(SETS)
        if not file.exists():
            file.write_bytes(pickle.dumps(found_sets(diagnosis, job.case, job.file.parent)))
        recording: LinearRecording = pickle.loads(file.read_bytes())
        sets = {frames: evidences(recording, frames) for frames in FRAMES}
        part = PARTS[2 if photographs else is_held_out(int(job.name[-3:]))]
        evidence = read_evidence(job.file.with_name(FINDINGS))
        one = Question(job.found(), decide(evidence), sets, recording.singles, part)
        yield one
        rest = without(evidence, one.right)
        if one.truth.is_alone and rest.findings.singles:
            yield one._replace(unknown=one.right, rules=decide(rest))


def without(evidence: Evidence, names: Collection[str]) -> Evidence:
    """Return `evidence` as it is if the effects `names` are not in the library."""

    def known(fits: Sequence[Fit]) -> list[int]:
        return [
            number
            for number, fit in enumerate(fits)
            if {member.effect for member in fit.members}.isdisjoint(names)
        ]

    found = evidence.findings
    changed: dict[str, Any] = {}
    for kind in ('screened', 'singles', 'distances', 'pairs', 'pair_distances', 'triples'):
        fits = {'distances': found.singles, 'pair_distances': found.pairs}.get(kind)
        values = getattr(found, kind)
        changed[kind] = [values[number] for number in known(values if fits is None else fits)]
    rest = replace(found, **changed)
    return (
        replace(evidence, findings=rest, explanation=explain(rest))
        if rest.singles
        else (replace(evidence, findings=rest))
    )


def found_sets(diagnosis: ChangedDiagnosis, case: BlindCase, folder: Path) -> LinearRecording:
    """Return the sets of the present search on the stored recording in `folder`."""
    file = folder / REMEMBERED
    memory = pickle.loads(file.read_bytes()) if file.exists() else {}
    found = diagnosis.judged(case, folder, memory, SimulationStore(folder / 'simulations'))
    return recording_of(found.levels, found.evidence.findings)


def rows_of(asked: Sequence[Question], numbers: tuple[float, float]) -> Iterator[list[str]]:
    """Yield the rows of the table of figures: part, library, method, and figures."""
    for part, unknown in product(PARTS, (False, True)):
        own = [one for one in asked if (one.part, bool(one.unknown)) == (part, unknown)]
        library = 'true effect left out' if unknown else 'whole'
        yield [part, library, 'rules', *figures([one.by_rules() for one in own])]
        yield [part, library, 'evidence', *figures([one.answer(*numbers) for one in own])]


FIGURES = (
    'cases', 'right', 'right in whole', 'sure and wrong', 'sure of a wrong name',
    'calibration error',
)  # fmt: skip
"""Headings of the figures of answers."""


def figures(answers: Sequence[StatedSets]) -> list[str]:
    """Return `FIGURES` of the `answers` as words."""
    error = expected_error([a.confidence for a in answers], [a.is_right for a in answers])
    return [
        str(len(answers)),
        str(sum(a.is_right for a in answers)),
        str(sum(a.is_whole for a in answers)),
        str(sum(a.is_sure_and_wrong for a in answers)),
        str(sum(a.is_sure_of_a_wrong_name for a in answers)),
        f'{error:.3f}',
    ]


def main() -> None:
    """Fit both numbers to the recordings that are not held out, and print the figures of all."""
    parser = argparse.ArgumentParser(prog='python -m lab.stored.laplace')
    parser.add_argument('folder', type=Path)
    parser.add_argument('--seed', type=int, default=31, help='seed of the stored recordings')
    parser.add_argument('--photographs', type=Path, help='folder with stored photographs')
    parser.add_argument('--photographs-seed', type=int, default=9101)
    given = parser.parse_args()
    asked = list(questions(given.folder.resolve(), given.seed))
    if given.photographs:
        seen = given.photographs.resolve()
        asked += questions(seen, given.photographs_seed, photographs=True)
    chosen = [one for one in asked if one.part == PARTS[0]]
    numbers = max(
        product(FRAMES, TEMPERS), key=lambda both: sum(q.log_score(*both) for q in chosen)
    )
    for one in asked:
        words = [one.part, one.truth.name, '+'.join(one.truth.truth) or NONE]
        words += ['left out'] if one.unknown else []
        for method, told in (('rules', one.by_rules()), ('evidence', one.answer(*numbers))):
            words.append(f'{method} {"+".join(told.first)} {told.confidence:.2f}')
            words += [] if told.is_right else ['WRONG']
        print(*words)
    columns = ['part', 'library', 'method', *FIGURES]
    title = f'frames {numbers[0]:g}, temper {numbers[1]:.3f}'
    print_table(title, columns, list(rows_of(asked, numbers)))


if __name__ == '__main__':
    main()
