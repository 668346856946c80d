"""Equal photographs in a row are told; equal ones that are apart, or cannot be read, are not."""

from collections.abc import Callable

from porotwin_cli.photographs.same_photos import PhotoDigests, SameFiles, told
from porotwin_core.basis.errors import InputError
from porotwin_recording.tables.photos import Photo


def photos(*contents: bytes | None) -> list[Photo]:
    """Return photographs a, b, c, ... with these files; None cannot be read."""

    def reader(content: bytes | None) -> Callable[[], bytes]:
        def read() -> bytes:
            if content is None:
                raise InputError('is damaged')
            return content

        return read

    return [
        Photo(float(number), 'state', 'abcdefghijkl'[number], reader(content))
        for number, content in enumerate(contents)
    ]


def test_rows_of_equal_files_are_named_with_their_ends() -> None:
    found = PhotoDigests().same_files(photos(b'1', b'2', b'2', b'2', b'3', b'2', b'4', b'4'))
    assert found == [SameFiles('b', 'd', 3), SameFiles('g', 'h', 2)]
    assert 'b to d: 3 photographs in a row' in str(found[0])


def test_files_that_cannot_be_read_equal_no_other() -> None:
    assert PhotoDigests().same_files(photos(None, None, b'1')) == []


def test_a_noted_file_is_not_read_again() -> None:
    digests, (first, second) = PhotoDigests(), photos(None, b'1')
    digests.note(first, b'1')
    assert digests.same_files([first, second]) == [SameFiles('a', 'b', 2)]


def test_few_rows_are_told_one_by_one() -> None:
    runs = [SameFiles(name, name.upper(), 2) for name in 'abcde']
    assert [line[:6] for line in told(runs)] == ['a to A', 'b to B', 'c to C', '2 more']
