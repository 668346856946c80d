"""Changed numbers of the diagnosis, judged by stored recordings.

    nice -n 15 python -m lab.stored.ablation FOLDER OUTPUT.json [--changes FILE] [--held-out]
    python -m lab.stored.ablation FOLDER OUTPUT.json --changes FILE --decide

The present rules judge every stored recording again. A table `[NAME]` of a TOML file holds
constants with their new values as Python, such as `SUFFICIENT_MISFIT = "0.265"`. Every change is
tried alone. The printed table tells which verdicts it changes. Recordings that are held out count
only with `--held-out`. With `--decide` the stored findings are decided again without a search: it
takes a second, and tells of numbers of the decision only.
"""

import argparse
import importlib
import json
import pickle
import sys
import time
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import FrameType, ModuleType

from lab.blind.blind_cases import BlindCase
from lab.blind.simulation_store import SimulationStore
from lab.stored.changed_numbers import PACKAGE, Changes, load_afresh
from lab.stored.remembered_fits import Memory, inner_changes, remember
from lab.stored.stored_cases import (
    FINDINGS,
    StoredJob,
    StoredVerdict,
    is_held_out,
    stored_jobs,
    stored_verdict,
)
from porotwin_cli.terminal import print_table
from porotwin_core.basis.whole_file import write_whole
from porotwin_diagnosis.examine import Judged
from porotwin_recording.experiment.recording import open_recording

STORED, PRESENT = 'as stored', 'present'
"""Names of the verdicts that were stored, and of those without a change."""


REMEMBERED = 'remembered.pickle'
"""File with the fits of a stored recording, beside its verdict; the next call begins with them."""


class ChangedDiagnosis:
    """The package with changed numbers."""

    def __init__(self, name: str, changes: Changes) -> None:
        """Load the package; `name` is the name of the changes."""
        self.name, self.changes = name, changes
        self._memory: Memory = {}
        load_afresh(changes)
        self._modules = {
            key: module for key, module in sys.modules.items() if key.split('.')[0] == PACKAGE
        }
        remember(self._modules, lambda: self._memory, inner_changes(changes))

    def verdict(self, case: BlindCase, folder: Path, memory: Memory) -> StoredVerdict:
        """Return the verdict on the stored recording of `case`, with the `memory` of its fits."""
        store = SimulationStore(folder / 'simulations')
        begin = time.process_time()
        judged = self.judged(case, folder, memory, store)
        seconds = time.process_time() - begin
        return stored_verdict(case, judged.verdict, store.made, seconds)

    def decided(self, case: BlindCase, folder: Path) -> StoredVerdict:
        """Return the verdict on the stored findings of `case`."""
        self._enter()
        reader = importlib.import_module(f'{PACKAGE}.report.evidence_json')
        evidence = reader.read_evidence(folder / FINDINGS)
        verdict = self.module('decision.verdict_rules').decide(evidence)
        return stored_verdict(case, verdict, 0, 0.0)

    def _enter(self) -> None:
        """Make the package with the changes the loaded one."""
        for name in [one for one in sys.modules if one.split('.')[0] == PACKAGE]:
            del sys.modules[name]
        sys.modules.update(self._modules)

    def judged(
        self, case: BlindCase, folder: Path, memory: Memory, store: SimulationStore
    ) -> Judged:
        """Return the verdict with all that it was made from; the package stays loaded."""
        self._memory = memory
        self._enter()
        recording = self.module('data.false_cells').without_false_cells(
            open_recording(folder / 'recording')
        )
        examine = self.module('examine')
        settings = examine.DiagnosisSettings(excluded=case.withheld, crew=store)
        found: Judged = examine.judge([recording], settings)
        return found

    def module(self, name: str) -> ModuleType:
        """Return the module `name` of the package, with the changes."""
        return self._modules[f'{PACKAGE}.{name}']


@dataclass(frozen=True)
class Outcome:
    """The effect of a change: its name, and the recordings whose verdicts it changes.

    Attributes:
        name: name of the change.
        judged: recordings that were judged.
        right: right verdicts.
        sure_and_wrong: verdicts that are sure and wrong.
        changed: the changed verdicts, in words.
        seconds: CPU time [s].
        made: new simulations.
    """

    name: str
    judged: int
    right: int
    sure_and_wrong: int
    changed: tuple[str, ...]
    seconds: float
    made: int


def effect_of(
    name: str, found: Sequence[StoredVerdict], baseline: Mapping[str, StoredVerdict]
) -> Outcome:
    """Return what the change `name`, with the verdicts `found`, does to those of the `baseline`."""
    return Outcome(
        name,
        len(found),
        sum(one.is_right for one in found),
        sum(one.is_sure_and_wrong for one in found),
        tuple(_difference(baseline[one.name], one) for one in found
              if _statement(one) != _statement(baseline[one.name])),
        sum(one.seconds for one in found),
        sum(one.simulations for one in found),
    )  # fmt: skip


def _statement(one: StoredVerdict) -> tuple[object, ...]:
    return (one.verdict, one.members, one.listed, one.is_sure_and_wrong)


def _difference(old: StoredVerdict, new: StoredVerdict) -> str:
    sides = [
        f'{" + ".join(one.members) or one.verdict} {one.confidence}'
        f'{"" if one.is_right else " (wrong)"}'
        for one in (old, new)
    ]
    return f'{old.name} {"+".join(old.truth) or "none"}: {sides[0]} -> {sides[1]}'


def decisions(
    folder: Path, changes: Mapping[str, Changes], *, seed: int
) -> Iterator[tuple[str, StoredVerdict]]:
    """Yield the name of each change and its verdict on the stored findings of each recording."""
    diagnoses = [ChangedDiagnosis(name, change) for name, change in changes.items()]
    for job in _jobs(folder, seed):
        if job.file.with_name(FINDINGS).exists():
            yield STORED, job.found()
            for one in diagnoses:
                yield one.name, one.decided(job.case, job.file.parent)


def _jobs(folder: Path, seed: int) -> list[StoredJob]:
    count = max((int(path.name[-3:]) for path in folder.glob('case_*')), default=-1) + 1
    return stored_jobs(folder, count, seed)


def verdicts(
    folder: Path, changes: Mapping[str, Changes], *, held_out: bool, seed: int
) -> Iterator[tuple[str, StoredVerdict]]:
    """Yield the name of each change and its verdict, recording by recording.

    All changes share the fits of a recording.
    """
    diagnoses = [ChangedDiagnosis(name, change) for name, change in changes.items()]
    for number, job in enumerate(_jobs(folder, seed)):
        if is_held_out(number) != held_out or not job.file.exists():
            continue
        file = job.file.with_name(REMEMBERED)
        memory: Memory = pickle.loads(file.read_bytes()) if file.exists() else {}
        first, *others = diagnoses
        yield STORED, job.found()
        first.verdict(job.case, job.file.parent, memory)
        with names_used() as used:
            baseline = first.verdict(job.case, job.file.parent, memory)
        yield first.name, baseline
        for diagnosis in others:
            if used.isdisjoint(diagnosis.changes) and ALWAYS.isdisjoint(diagnosis.changes):
                yield diagnosis.name, replace(baseline, seconds=0.0)
            else:
                yield diagnosis.name, diagnosis.verdict(job.case, job.file.parent, memory)
        begun = file.with_suffix('.begun')
        begun.write_bytes(pickle.dumps(memory))
        begun.replace(file)


ALWAYS = {'SMOOTHING_WIDTH'}
"""Numbers that are defaults of parameters: `names_used` does not see them."""


@contextmanager
def names_used() -> Iterator[set[str]]:
    """Return the set of all names that the functions may use that run in the context."""
    used: set[str] = set()

    def note(frame: FrameType, event: str, _argument: object) -> None:
        if event == 'call':
            used.update(frame.f_code.co_names)

    sys.setprofile(note)
    try:
        yield used
    finally:
        sys.setprofile(None)


def main() -> None:
    """Try the changes, and print the table."""
    parser = argparse.ArgumentParser(prog='python -m lab.stored.ablation')
    parser.add_argument('folder', type=Path)
    parser.add_argument('output', type=Path, help='file for all verdicts')
    parser.add_argument('--changes', type=Path, help='file with changes of numbers')
    parser.add_argument('--held-out', action='store_true')
    parser.add_argument('--decide', action='store_true', help='from the stored findings')
    parser.add_argument('--seed', type=int, default=31, help='seed of the stored recordings')
    given = parser.parse_args()
    changes: dict[str, Changes] = {PRESENT: {}}
    if given.changes:
        changes |= tomllib.loads(given.changes.read_text(encoding='utf-8'))
    found: dict[str, list[StoredVerdict]] = {name: [] for name in (STORED, *changes)}
    folder = given.folder.resolve()
    judged = verdicts(folder, changes, held_out=given.held_out, seed=given.seed)
    if given.decide:
        judged = decisions(folder, changes, seed=given.seed)
    for name, verdict in judged:
        found[name].append(verdict)
        content = {key: [asdict(one) for one in values] for key, values in found.items()}
        write_whole(given.output, json.dumps(content))
        print(name, verdict.name, verdict.verdict, verdict.confidence, f'{verdict.seconds:.1f}',
              verdict.simulations, file=sys.stderr, flush=True)  # fmt: skip
    stored, present = ({one.name: one for one in found[name]} for name in (STORED, PRESENT))
    effects = [
        effect_of(name, values, stored if name == PRESENT else present)
        for name, values in found.items()
    ]
    print_table(
        'changed numbers',
        ['change', 'recordings', 'right', 'sure and wrong', 'changed', 'CPU s', 'new simulations'],
        [
            [one.name, str(one.judged), str(one.right), str(one.sure_and_wrong),
             '; '.join(one.changed), f'{one.seconds:.0f}', str(one.made)]
            for one in effects
        ],
    )  # fmt: skip


if __name__ == '__main__':
    main()
