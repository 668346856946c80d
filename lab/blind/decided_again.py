"""The cases of blind checks, decided again by the present rules without a simulation.

    python -m lab.blind.decided_again blind [MORE ...]

Every folder is the output of a finished blind check. After a change of a threshold of the decision,
the table shows the new confidences beside those that were stated and the share of right verdicts,
by the doubt that sets the confidence. A verdict with another name needs a new score; it is listed.
"""

import json
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from lab.blind.blind_table import expected_error
from lab.blind.confidence_fit import error_by_chance
from porotwin_diagnosis.decision.verdict_rules import decide
from porotwin_diagnosis.report.evidence_json import read_evidence

FINDINGS = Path('result') / 'findings.json'
"""The evidence of a case, in its folder."""


class DecidedCase(NamedTuple):
    """One case: its name, the doubt, both confidences, and whether the verdict is confirmed.

    `renamed` is the new verdict if it has another name, else ''.
    """

    name: str
    doubt: str
    stated: float
    now: float
    confirmed: bool
    renamed: str = ''


def decided_cases(folders: Iterable[Path]) -> Iterator[DecidedCase]:
    """Yield the cases of the blind checks in `folders` that have evidence."""
    for folder in folders:
        scores = json.loads((folder / 'scores.json').read_text(encoding='utf-8'))['cases']
        for score in scores:
            evidence = folder / score['name'] / FINDINGS
            if not evidence.is_file():
                continue
            verdict = decide(read_evidence(evidence))
            yield DecidedCase(
                name=f'{folder}/{score["name"]}',
                doubt=verdict.doubt.value,
                stated=score['confidence'],
                now=verdict.confidence,
                confirmed=score['right'] or score['listed'],
                renamed='' if verdict.name == score['verdict'] else verdict.name,
            )


def doubt_table(cases: Sequence[DecidedCase]) -> list[str]:
    """Return the lines of a Markdown table of `cases` by their doubt; renamed ones do not count."""
    kept = [case for case in cases if not case.renamed]
    by_doubt = {
        doubt: [case for case in kept if case.doubt == doubt]
        for doubt in sorted({case.doubt for case in kept})
    }
    return [
        '| least certain | cases | stated | now | right or listed |',
        '| --- | --- | --- | --- | --- |',
        *(_row(doubt, own) for doubt, own in by_doubt.items()),
        *([_row('all', kept)] if kept else []),
    ]


def _row(name: str, cases: Sequence[DecidedCase]) -> str:
    count = len(cases)
    stated, now, right = (
        sum(getattr(case, field) for case in cases) / count
        for field in ('stated', 'now', 'confirmed')
    )
    return f'| {name} | {count} | {stated:.2f} | {now:.2f} | {right:.2f} |'


def main() -> None:
    """Print the table of the folders on the command line, and the calibration errors."""
    cases = list(decided_cases(Path(name) for name in sys.argv[1:]))
    print('\n'.join(doubt_table(cases)))
    kept = [case for case in cases if not case.renamed]
    confirmed, now = [case.confirmed for case in kept], [case.now for case in kept]
    if kept:
        before = expected_error([case.stated for case in kept], confirmed)
        print(
            f'calibration error {before:.3f} as stated, {expected_error(now, confirmed):.3f} now; '
            f'true confidences would have {error_by_chance(now):.3f} by chance'
        )
    for case in cases:
        if case.renamed:
            print(f'{case.name}: {case.renamed} now')


if __name__ == '__main__':
    main()
