"""The hidden truths of a blind check: published as hashes first, opened after the diagnosis.

Nobody can change a truth afterwards without changing its hash.
"""

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path

from porotwin_core.errors import InputError
from porotwin_validation.blind_cases import BlindCase

HASHES = 'truth_hashes.json'
"""File with the SHA-256 hash of every case's truth."""


def publish_hashes(folder: Path, cases: Sequence[BlindCase], seed: int) -> None:
    """Write the hashes of the truths of `cases`, beside those that were published before.

    Raises:
        InputError: another truth of a case was published already.
    """
    hashes = {case.name: _hash(case) for case in cases}
    path = folder / HASHES
    if path.exists():
        known = json.loads(path.read_text(encoding='utf-8'))['sha256']
        changed = [name for name in known.keys() & hashes.keys() if known[name] != hashes[name]]
        if changed:
            raise InputError(
                f'{path}: {changed[0]} was published with another truth; name another folder'
            )
        hashes = {**known, **hashes}
    path.write_text(json.dumps({'seed': seed, 'sha256': hashes}, indent=1), encoding='utf-8')


def open_truth(case: BlindCase, folder: Path) -> None:
    """Write the truth of `case` into its folder, after its diagnosis."""
    (folder / 'truth.json').write_text(truth_text(case), encoding='utf-8')


def truth_text(case: BlindCase) -> str:
    """Return the truth of `case` as JSON: the text that is hashed."""
    content = {
        'name': case.name,
        'kind': case.kind,
        'right': list(case.right),
        'withheld': list(case.withheld),
        'effects': [effect.model_dump() for effect in case.effects],
        'seed': case.seed,
    }
    return json.dumps(content, sort_keys=True, indent=1)


def _hash(case: BlindCase) -> str:
    return hashlib.sha256(truth_text(case).encode('utf-8')).hexdigest()
