"""Tests of the YAML reader: numbers and words are read as they look, no key stands twice."""

from itertools import pairwise
from pathlib import Path

import pytest
import yaml

from porotwin_core.basis.errors import InputError
from porotwin_core.rig.rig_file import rig_file
from porotwin_core.rig.yaml_reader import LARGEST_TEXT, read_yaml, read_yaml_file, yaml_text


@pytest.mark.parametrize(
    ('text', 'value'),
    [
        ('1e-3', 1e-3),
        ('6.57e-10', 6.57e-10),
        ('.5', 0.5),
        ('010', 10),
        ('-3', -3),
        ('0x3E6', 998),
        ('0o7', 7),
        ('no', 'no'),
        ('on', 'on'),
        ('true', True),
        ('1:30', '1:30'),
        ('1_000', '1_000'),
        ('0,01', '0,01'),
        ('~', None),
    ],
)
def test_a_value_means_what_it_shows(text: str, value: object) -> None:
    found = read_yaml(f'key: {text}\r\n')['key']
    assert found == value
    assert type(found) is type(value)


def test_keys_are_texts() -> None:
    assert read_yaml('no: {1: a, 2.5: b}') == {'no': {'1': 'a', '2.5': 'b'}}


def test_a_byte_order_mark_is_no_part_of_the_first_key() -> None:
    assert read_yaml('\ufeffname: small') == {'name': 'small'}


def test_a_key_that_stands_twice_is_named_with_its_lines() -> None:
    with pytest.raises(yaml.YAMLError, match="'depth_m' stands twice, in the lines 1 and 3"):
        read_yaml('depth_m: 0.01\nname: a\ndepth_m: 0.02\n')


def test_sections_may_be_merged() -> None:
    text = 'a: &a {x: 1, y: 2}\nb:\n  <<: *a\n  y: 3\n'
    assert read_yaml(text)['b'] == {'x': 1, 'y': 3}


@pytest.mark.parametrize(
    ('content', 'line'),
    [
        (None, 'no such file; write one'),
        (b'name: caf\xe9', 'not a text in UTF-8; save it as UTF-8'),
        (b'[' * 5000, 'nested too deeply; correct it'),
        (b'a: {', 'not readable as YAML: while parsing'),
        (b'a: 2026-99-99', 'not readable as YAML: month must be in 1..12'),
        (b'\na: !!bool maybe', '\'maybe\' is no bool in "<unicode string>", line 2, column 4'),
        (b'a: !!timestamp b', "'b' is no timestamp"),
        (b"a: !!float ''", "'' is no float"),
        (b'a: 1\na: 2', "the key 'a' stands twice, in the lines 1 and 2"),
    ],
)
def test_a_file_that_is_no_yaml_gets_one_line(tmp_path, content, line):
    path = tmp_path / 'odd.yaml'
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError) as refusal:
        read_yaml_file(path, remedy='write one')
    assert line in str(refusal.value)
    assert str(refusal.value).startswith(f'{path}: ')
    assert '\n' not in str(refusal.value)


@pytest.mark.parametrize('text', ['2e1', '.5e3', '010', '1:30', 'no', '12', 'a: b', 'café', '~'])
def test_a_text_that_looks_like_something_else_is_written_as_a_text(text):
    data = {'name': text, 'sizes': [1e-14, 20.0, 3]}
    assert read_yaml(yaml_text(data)) == data


def test_a_folder_is_no_yaml(tmp_path):
    with pytest.raises(InputError, match='is a folder; name a file in it'):
        read_yaml_file(tmp_path, remedy='write one')


def test_a_name_that_is_too_long_is_no_yaml(tmp_path):
    with pytest.raises(InputError, match=r'cannot be read \(File name too long\)'):
        read_yaml_file(rig_file(tmp_path / ('x' * 300)), remedy='write one')


def test_a_document_that_repeats_itself_without_end_is_refused(tmp_path: Path) -> None:
    names = 'abcdefghij'
    nine = [(name, ', '.join([f'*{before}'] * 9)) for before, name in pairwise(names)]
    for lines in (
        ['a: &a {x: 1}', *(f'{name}: &{name}\n  <<: [{parts}]' for name, parts in nine)],
        ['a: &a {x: 1}', *(f'{name}: &{name} [{parts}]' for name, parts in nine)],
        ['a: &a', '  inside: *a'],
    ):
        file = tmp_path / 'rig.yaml'
        file.write_text('\n'.join(lines))
        with pytest.raises(InputError, match='values'):
            read_yaml_file(file, remedy='')


def test_a_file_that_is_far_too_long_is_refused_unread(tmp_path: Path) -> None:
    file = tmp_path / 'rig.yaml'
    with file.open('wb') as stream:
        stream.truncate(LARGEST_TEXT + 1)
    with pytest.raises(InputError, match='bytes'):
        read_yaml_file(file, remedy='')


def test_aliases_that_people_write_are_read() -> None:
    found = read_yaml('sand: &sand {porosity: 0.4}\nfine: {<<: *sand, name: x}\nlist: [*sand]')
    assert found['fine'] == {'porosity': 0.4, 'name': 'x'}
    assert found['list'] == [{'porosity': 0.4}]
