"""Hashes of the hidden truths: published once, opened afterwards."""

import hashlib
import json

import pytest

from lab.blind.blind_cases import draw_case
from lab.blind.blind_hashes import open_truth, publish_hashes
from porotwin_core.basis.errors import InputError


def test_a_truth_cannot_be_changed_after_its_hash_is_published(tmp_path):
    publish_hashes(tmp_path, [draw_case(0, 1)], 1)
    publish_hashes(tmp_path, [draw_case(0, 1), draw_case(1, 1)], 1)
    with pytest.raises(InputError, match='another truth'):
        publish_hashes(tmp_path, [draw_case(0, 2)], 2)


def test_an_opened_truth_has_the_published_hash(tmp_path):
    case = draw_case(1, 1)
    publish_hashes(tmp_path, [case], 1)
    published = json.loads((tmp_path / 'truth_hashes.json').read_text())['sha256'][case.name]
    open_truth(case, tmp_path)
    assert hashlib.sha256((tmp_path / 'truth.json').read_bytes()).hexdigest() == published


def test_maps_and_photographs_do_not_share_a_folder(tmp_path):
    publish_hashes(tmp_path, [draw_case(0, 1)], 1)
    with pytest.raises(InputError, match='a check from maps'):
        publish_hashes(tmp_path, [draw_case(0, 1)], 1, 'photographs')


def test_coarse_and_fine_cells_do_not_share_a_folder(tmp_path):
    publish_hashes(tmp_path, [draw_case(0, 1)], 1)
    with pytest.raises(InputError, match='other cells'):
        publish_hashes(tmp_path, [draw_case(0, 1, coarse=True)], 1)


@pytest.mark.parametrize('content', ['', '{"sha256"', '[]', '{"sha256": 5}'])
def test_damaged_hashes_are_refused(tmp_path, content):
    (tmp_path / 'truth_hashes.json').write_text(content)
    with pytest.raises(InputError, match='is damaged; name another folder'):
        publish_hashes(tmp_path, [draw_case(0, 1)], 1)
