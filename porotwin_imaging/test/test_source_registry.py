"""Camera sources are found by name."""

import pytest

from porotwin_core.errors import InputError
from porotwin_imaging.sources.source_registry import SOURCES, source_at


def test_the_modules_of_the_folder_are_found() -> None:
    assert {'device', 'folder'} <= set(SOURCES)
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
    ],
)
def test_an_address_without_a_name_is_a_device(text: str, name: str, address: str) -> None:
    kind, found = source_at(text)
    assert (kind.name, found) == (name, address)


@pytest.mark.parametrize('text', ['', 'gramophone:/dev/null'])
def test_unknown_sources_are_refused_with_a_list_of_all(text: str) -> None:
    with pytest.raises(InputError, match=r'no camera source.*device:.*folder:'):
        source_at(text)
