"""The hidden truths of a blind check: published as hashes first, opened after the diagnosis.

Nobody can change a truth afterwards without changing its hash.
"""

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

from lab.blind.blind_cases import BlindCase
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.whole_file import write_whole

HASHES = 'truth_hashes.json'
"""File with the SHA-256 hash of every case's truth."""


Source = Literal['maps', 'photographs']
"""Input of the diagnosis: maps of the rig with noise, or maps made from photographs of it."""


def publish_hashes(
    folder: Path, cases: Sequence[BlindCase], seed: int, source: Source = 'maps'
) -> None:
    """Write the hashes of the truths of `cases`, beside those that were published before.

    Raises:
        InputError: another truth of a case or another cell size was published already, the folder
            holds a check from another source, or its hashes are damaged.
    """
    hashes = {case.name: _hash(case) for case in cases}
    path = folder / HASHES
    if path.exists():
        content = _published(path)
        before = content.get('from', 'maps')
        if before != source:
            raise InputError(f'{path}: a check from {before}; name another folder')
        known = content['sha256']
        changed = [name for name in known.keys() & hashes.keys() if known[name] != hashes[name]]
        if changed:
            raise InputError(
                f'{path}: {changed[0]} was published with another truth or other cells; '
                'name another folder'
            )
        hashes = {**known, **hashes}
    content = {'seed': seed, 'from': source, 'sha256': hashes}
    write_whole(path, json.dumps(content, indent=1))


def _published(path: Path) -> dict[str, Any]:
    """Return the content of the file with the hashes.

    Raises:
        InputError: it is damaged.
    """
    try:
        content = json.loads(path.read_text(encoding='utf-8'))
        return {'sha256': dict(content['sha256']), **content}
    except (ValueError, LookupError, TypeError):
        raise InputError(f'{path}: is damaged; name another folder') from None


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
        'cell_m': case.cell_m,
    }
    return json.dumps(content, sort_keys=True, indent=1)


def _hash(case: BlindCase) -> str:
    return hashlib.sha256(truth_text(case).encode('utf-8')).hexdigest()
