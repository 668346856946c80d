"""The hash of a file is the one that other programs print."""

from pathlib import Path

from porotwin_imaging.photograph.file_hash import sha256_of_file


def test_the_hash_is_that_of_sha256sum(tmp_path: Path) -> None:
    path = tmp_path / 'calibration.yaml'
    path.write_bytes(b'abc')
    assert sha256_of_file(path).startswith('ba7816bf8f01cfea414140de5dae2223')
    assert sha256_of_file('') == sha256_of_file(None) == ''
