"""Camera sources are found by name."""

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_imaging.sources.source_registry import SOURCES, check_source, source_at


def test_the_modules_of_the_folder_are_found() -> None:
    assert {'device', 'folder', 'gphoto2', 'snapshot'} <= set(SOURCES)
    assert all(name == kind.name and kind.address for name, kind in SOURCES.items())


@pytest.mark.parametrize(
    ('text', 'name', 'address'),
    [
        ('folder:/mnt/camera', 'folder', '/mnt/camera'),
        ('device:0', 'device', '0'),
        ('/dev/video0', 'device', '/dev/video0'),
        ('/dev/v4l/by-path/pci-0000:00:14.0', 'device', '/dev/v4l/by-path/pci-0000:00:14.0'),
        ('rtsp://camera/stream', 'device', 'rtsp://camera/stream'),
        ('2', 'device', '2'),
        ('http://camera/snap.jpg', 'snapshot', 'http://camera/snap.jpg'),
        ('device:http://camera/stream', 'device', 'http://camera/stream'),
        ('gphoto2:usb:001,004', 'gphoto2', 'usb:001,004'),
    ],
)
def test_an_address_without_a_name_is_a_device(text: str, name: str, address: str) -> None:
    kind, found = source_at(text)
    assert (kind.name, found) == (name, address)


@pytest.mark.parametrize('text', ['', ' ', 'folder:', 'gramophone:/dev/null', 'nonsense:'])
def test_unknown_sources_are_refused_with_a_list_of_all(text: str) -> None:
    with pytest.raises(InputError, match=r'no camera source.*device:.*folder:'):
        source_at(text)


@pytest.mark.parametrize(
    ('text', 'complaint'),
    [
        ('nonsense:', 'no camera source'),
        ('folder:/nonexistent', 'no such folder'),
        ('device:/dev/video99', 'does not exist'),
        ('/dev/video99', 'does not exist'),
        ('snapshot:camera', 'camera URL'),
        ('gphoto2:Canon EOS', 'is no port'),
    ],
)
def test_a_wrong_source_is_refused_before_nodes_start(text: str, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint) as found:
        check_source(text)
    assert len(str(found.value).splitlines()) == 1


def test_a_folder_is_accepted(tmp_path) -> None:
    check_source(f'folder:{tmp_path}')
