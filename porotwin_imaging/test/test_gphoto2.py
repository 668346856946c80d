"""A tethered camera, with a fake program gphoto2 on the path."""

import os
from pathlib import Path

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_imaging.sources.gphoto2 import SOURCE, TetheredSource, check_port

FAKE = """#!/bin/sh
echo "$@" >> "{folder}/calls"
for argument; do
  if [ "$previous" = --filename ]; then target=$argument; fi
  previous=$argument
done
. "{folder}/behaviour"
"""


class FakeCamera:
    """A camera behind the fake program; `does` gives shell commands, `$to` is the file's name."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        program = folder / 'gphoto2'
        program.write_text(FAKE.format(folder=folder))
        program.chmod(0o755)
        self.does('')

    def does(self, commands: str) -> None:
        text = f'to=${{target%\\%f.%C}}; photo="{self.folder}/photo.jpg"\n{commands}\n'
        (self.folder / 'behaviour').write_text(text)

    def calls(self) -> list[str]:
        return (self.folder / 'calls').read_text().splitlines()


@pytest.fixture
def camera(tmp_path, monkeypatch, empty_photograph) -> FakeCamera:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('PATH', f'{tmp_path}{os.pathsep}{os.environ["PATH"]}')
    (tmp_path / 'photo.jpg').write_bytes(empty_photograph)
    return FakeCamera(tmp_path)


def test_each_poll_takes_a_photograph(camera, empty_photograph) -> None:
    camera.does('cp "$photo" "${to}IMG_1.JPG"; echo raw > "${to}IMG_1.CR2"')
    source = TetheredSource('usb:001,004', clock=lambda: 12.0)
    for _ in range(2):
        (photo,) = source.poll().photos
        assert (photo.data, photo.time, photo.name) == (empty_photograph, 12.0, 'IMG_1.JPG')
    assert len(camera.calls()) == 2
    assert camera.calls()[0].startswith(
        '--port usb:001,004 --capture-image-and-download --force-overwrite --filename '
    )


def test_settings_are_made_once_and_again_after_an_absence(camera) -> None:
    source = SOURCE.open('auto', config='iso=100, shutterspeed=1/60')
    camera.does("echo '*** Error: No camera found. ***' >&2; exit 1")
    assert source.poll().absent == 'gphoto2 failed: Error: No camera found.'
    camera.does('[ -z "$target" ] || cp "$photo" "${to}IMG_1.JPG"')
    polled = source.poll()
    assert polled.remarks == ('camera set to iso=100, shutterspeed=1/60',)
    assert len(polled.photos) == 1
    source.poll()
    settings = [call for call in camera.calls() if '--set-config' in call]
    assert settings == ['--set-config iso=100 --set-config shutterspeed=1/60'] * 2
    camera.does('exit 1')
    assert source.poll().absent == 'gphoto2 failed: 1'
    camera.does('cp "$photo" "${to}IMG_1.JPG"')
    assert source.poll().remarks


@pytest.mark.parametrize(
    ('commands', 'complaint'),
    [
        ('exit 0', 'took no photograph'),
        ('printf "\\377\\n*** Error (-1: x) ***" >&2; exit 3', 'gphoto2 failed: Error (-1: x)'),
    ],
)
def test_a_camera_that_takes_no_photograph_is_absent(camera, commands, complaint) -> None:
    camera.does(commands)
    polled = TetheredSource().poll()
    assert complaint in polled.absent
    assert polled.photos == []


def test_a_program_that_hangs_is_ended(camera) -> None:
    camera.does('sleep 600 & sleep 600')
    assert 'is not done after 0.2 s' in TetheredSource(timeout_s=0.2).poll().absent


def test_a_raw_photograph_is_a_problem(camera) -> None:
    camera.does('echo raw > "${to}IMG_1.CR2"')
    (problem,) = TetheredSource().poll().problems
    assert (problem.key, problem.code) == ('IMG_1.CR2', 'other_format')


def test_wrong_ports_settings_and_a_missing_program_are_refused(camera, monkeypatch) -> None:
    with pytest.raises(InputError, match='is no port; write gphoto2:auto'):
        check_port('Canon EOS')
    with pytest.raises(InputError, match="config 'iso' is not KEY=VALUE"):
        TetheredSource(config='iso')
    monkeypatch.setenv('PATH', str(camera.folder / 'nowhere'))
    with pytest.raises(InputError, match='gphoto2 is not installed'):
        check_port('auto')
