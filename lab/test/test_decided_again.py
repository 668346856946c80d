"""Cases of blind checks are decided again from their evidence."""

import json
from pathlib import Path

from diagnosis_examples import pair_evidence

from lab.blind.decided_again import decided_cases, doubt_table
from porotwin_diagnosis.decision.verdict_rules import decide
from porotwin_diagnosis.report.evidence_json import write_evidence


def blind_folder(folder: Path) -> Path:
    """Write a blind check with a case that is stated too sure and one with another name."""
    evidence = pair_evidence()
    cases = []
    for name, verdict in (('case_000', decide(evidence).name), ('case_001', 'leak')):
        (folder / name / 'result').mkdir(parents=True)
        write_evidence(folder / name / 'result' / 'findings.json', evidence)
        cases.append(
            {'name': name, 'verdict': verdict, 'confidence': 0.99, 'right': True, 'listed': False}
        )
    cases.append({**cases[0], 'name': 'case_002'})  # a refused calibration leaves no evidence
    (folder / 'scores.json').write_text(json.dumps({'cases': cases}))
    return folder


def test_cases_get_the_present_confidence_and_their_doubt(tmp_path: Path) -> None:
    same, renamed = decided_cases([blind_folder(tmp_path)])
    verdict = decide(pair_evidence())
    assert (same.stated, same.now, same.doubt) == (0.99, verdict.confidence, verdict.doubt.value)
    assert not same.renamed
    assert renamed.renamed == verdict.name


def test_the_table_counts_the_cases_of_each_doubt(tmp_path: Path) -> None:
    same, renamed = decided_cases([blind_folder(tmp_path)])
    wrong = same._replace(confirmed=False)
    table = doubt_table([same, wrong, renamed])
    assert table[2].startswith(f'| {same.doubt} | 2 | 0.99 |')
    assert table[2].endswith('| 0.50 |')
    assert doubt_table([renamed]) == table[:2]
