"""Photographs as files: complete, broken, dark and over-exposed ones."""

import contextlib
import io
import random
import struct

import cv2
import numpy as np
import pytest
from PIL import Image, ImageCms

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.orientation import orientation
from porotwin_imaging.photograph import photo_file


def pixels() -> np.ndarray:
    return np.random.default_rng(1).integers(60, 180, (240, 360, 3), dtype=np.uint8)


def encoded(kind: str, picture: np.ndarray) -> bytes:
    return cv2.imencode(kind, picture)[1].tobytes()


@pytest.mark.parametrize('kind', ['PNG', 'TIFF'])
@pytest.mark.parametrize('mode', ['P', '1'])
def test_a_palette_of_few_colours_is_refused(kind: str, mode: str) -> None:
    file = io.BytesIO()
    Image.fromarray(pixels()).convert(mode).save(file, kind)
    with pytest.raises(InputError, match='palette of at most 256 colours'):
        photo_file.decode(file.getvalue())


def test_lab_colours_are_refused() -> None:
    file = io.BytesIO()
    Image.fromarray(pixels()).convert('L').convert('RGB').save(file, 'TIFF')
    rgb, lab = (struct.pack('<HHIH', 262, 3, 1, colours) for colours in (2, 8))
    with pytest.raises(InputError, match='Lab colours; save it with RGB'):
        photo_file.decode(file.getvalue().replace(rgb, lab))


@pytest.mark.parametrize('kind', [np.float32, np.int32])
def test_levels_of_32_bits_are_refused_without_a_line_of_the_decoder(kind, capfd) -> None:
    file = io.BytesIO()
    Image.fromarray(pixels()[..., 0].astype(kind)).save(file, 'TIFF')
    assert photo_file.is_complete(file.getvalue())
    with pytest.raises(InputError, match='levels of 32 bits; save it with 8 or 16'):
        photo_file.decode(file.getvalue())
    assert capfd.readouterr().err == ''


@pytest.mark.parametrize('share', [0, 128, 255])
def test_transparency_does_not_darken_a_tiff(share: int) -> None:
    file = io.BytesIO()
    image = Image.fromarray(pixels()[..., ::-1])
    image.putalpha(share)
    image.save(file, 'TIFF')
    np.testing.assert_array_equal(photo_file.decode(file.getvalue()).pixels, pixels())


@pytest.mark.parametrize('kind', ['.jpg', '.png', '.tif'])
def test_size_and_completeness_by_format(kind: str) -> None:
    data = encoded(kind, pixels())
    assert photo_file.is_complete(data)
    assert photo_file.photo_size(data) == (360, 240)
    assert not photo_file.is_complete(data[: len(data) // 2])


@pytest.mark.parametrize('reduction', [1, 2, 4, 8])
def test_coarser_decoding_keeps_the_picture(reduction: int) -> None:
    smooth = cv2.GaussianBlur(pixels(), (0, 0), 12)
    found = photo_file.decode(encoded('.jpg', smooth), reduction)
    assert (found.width, found.height) == (360, 240)
    assert found.pixels.shape == (240 // reduction, 360 // reduction, 3)
    coarse = cv2.resize(smooth, found.pixels.shape[1::-1], interpolation=cv2.INTER_AREA)
    assert np.abs(found.pixels.astype(int) - coarse).max() <= 6


@pytest.mark.parametrize('kind', ['.png', '.tif'])
@pytest.mark.parametrize('reduction', [2, 4, 8])
def test_coarser_decoding_averages_whole_blocks(kind: str, reduction: int) -> None:
    picture = pixels()[:, :-3]  # the last block is not whole
    found = photo_file.decode(encoded(kind, picture), reduction).pixels
    assert found.shape == (240 // reduction, -(-357 // reduction), 3)
    inner = 357 // reduction
    blocks = picture[:, : inner * reduction].reshape(-1, reduction, inner, reduction, 3)
    assert np.abs(found[:, :inner] - blocks.mean(axis=(1, 3))).max() <= 1


@pytest.mark.parametrize('kind', ['JPEG', 'PNG', 'TIFF'])
@pytest.mark.parametrize('turned', [1, 3, 6])
@pytest.mark.parametrize('reduction', [1, 2])
def test_the_orientation_of_a_file_does_not_turn_its_pixels(kind, turned, reduction) -> None:
    smooth = cv2.GaussianBlur(pixels(), (0, 0), 12)
    tags = Image.Exif()
    tags[0x0112] = turned
    file = io.BytesIO()
    Image.fromarray(smooth[..., ::-1]).save(file, kind, exif=tags)
    data = file.getvalue()
    assert orientation(data) == turned
    assert photo_file.photo_size(data) == (360, 240)
    found = photo_file.decode(data, reduction).pixels
    coarse = cv2.resize(smooth, (360 // reduction, 240 // reduction), interpolation=cv2.INTER_AREA)
    assert found.shape == coarse.shape
    assert np.abs(found.astype(int) - coarse).max() <= 6


def test_a_camera_that_pads_its_files_is_read() -> None:
    assert photo_file.is_complete(encoded('.jpg', pixels()) + b'\0' * 16)


@pytest.mark.parametrize('progressive', [False, True])
def test_data_after_the_end_of_a_jpeg_are_ignored(progressive: bool) -> None:
    file = io.BytesIO()
    preview = encoded('.jpg', pixels()[:40, :60])
    tags = b'Exif\0\0' + preview  # a preview has an end marker of its own
    Image.fromarray(pixels()).save(file, 'JPEG', progressive=progressive, exif=tags, quality=90)
    data = file.getvalue()
    appended = photo_file.decode(data + b'MotionPhoto_Data' + bytes(range(256)) * 40)
    assert np.array_equal(appended.pixels, photo_file.decode(data).pixels)
    for length in (len(preview) + 100, len(data) // 2, len(data) - 1):
        assert not photo_file.is_complete(data[:length])


@pytest.mark.parametrize(
    ('data', 'complaint'),
    [
        (b'', 'not a JPEG'),
        (b'hello', 'not a JPEG'),
        (encoded('.jpg', pixels())[:9000], 'truncated'),
        (encoded('.jpg', pixels())[:400] + b'\xff\xd9', 'broken|black|over-exposed|not a JPEG'),
        (encoded('.jpg', pixels() // 40), 'black'),
        (encoded('.jpg', np.full((240, 360, 3), 255, np.uint8)), 'over-exposed'),
    ],
    ids=['empty', 'text', 'truncated', 'headless', 'black', 'white'],
)
def test_unusable_files_are_refused_in_one_line(data: bytes, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint) as error:
        photo_file.decode(data)
    assert '\n' not in str(error.value)


def test_a_header_with_an_impossible_size_is_refused() -> None:
    data = encoded('.tif', pixels())
    for tag in (256, 257):  # columns and rows
        for kind, size in ((3, 240), (3, 360), (4, 240), (4, 360)):
            entry = struct.pack('<HHII', tag, kind, 1, size)
            data = data.replace(entry, struct.pack('<HHII', tag, 4, 1, 1 << 22))
    assert not photo_file.is_complete(data)
    with pytest.raises(InputError, match='more than any camera has'):
        photo_file.decode(data)


def picture_of(kind: str) -> bytes:
    """Return a smooth picture as a file of a kind that cameras and programs write."""
    smooth = cv2.GaussianBlur(pixels(), (0, 0), 12)
    if kind in ('PNG 16', 'TIFF 16'):
        wide = smooth.astype(np.uint16) * 257
        return cv2.imencode('.png' if kind == 'PNG 16' else '.tiff', wide)[1].tobytes()
    mode = {'CMYK': 'CMYK', 'RGBA': 'RGBA', 'TIFF': 'RGB', 'progressive': 'RGB'}[kind]
    file = io.BytesIO()
    image = Image.fromarray(smooth[..., ::-1]).convert(mode)
    name = {'RGBA': 'PNG', 'TIFF': 'TIFF'}.get(kind, 'JPEG')
    image.save(file, name, **({'progressive': True, 'quality': 95} if name == 'JPEG' else {}))
    return file.getvalue()


@pytest.mark.parametrize('kind', ['PNG 16', 'TIFF 16', 'CMYK', 'RGBA', 'TIFF', 'progressive'])
def test_pictures_of_every_kind_have_the_same_pixels(kind: str) -> None:
    found = photo_file.decode(picture_of(kind)).pixels
    smooth = cv2.GaussianBlur(pixels(), (0, 0), 12)
    assert found.shape == smooth.shape
    assert np.abs(found.astype(int) - smooth).mean() < 4.0


@pytest.mark.parametrize('size', [100_000, 60_000])
@pytest.mark.parametrize('kind', ['JPEG', 'PNG', 'TIFF'])
def test_a_header_that_claims_any_size_is_refused_before_decoding(kind: str, size: int) -> None:
    file = io.BytesIO()
    Image.new('RGB', (30, 20), (90, 90, 90)).save(file, kind)
    data = bytearray(file.getvalue())
    side = min(size, 65_500) if kind == 'JPEG' else size
    if kind == 'JPEG':
        at = data.index(b'\xff\xc0') + 5
        data[at : at + 4] = struct.pack('>HH', side, side)
    elif kind == 'PNG':
        data[16:24] = struct.pack('>II', side, side)
    else:
        for tag in (256, 257):
            at = next(i for i in range(len(data)) if data[i : i + 2] == struct.pack('<H', tag))
            data[at : at + 12] = struct.pack('<HHII', tag, 4, 1, side)
    with pytest.raises(InputError, match=r'more than any camera|not a JPEG'):
        photo_file.decode(bytes(data))
    photo_file.is_complete(bytes(data))


def test_damaged_files_are_refused_or_decoded_and_nothing_else() -> None:
    generator = random.Random(5)
    for kind in ('PNG 16', 'CMYK', 'TIFF', 'progressive'):
        data = picture_of(kind)
        for _ in range(25):
            spoiled = bytearray(
                data[: generator.choice([len(data), generator.randrange(len(data))])]
            )
            for _ in range(3):
                if spoiled:
                    spoiled[generator.randrange(min(len(spoiled), 400))] = generator.randrange(256)
            photo_file.is_complete(bytes(spoiled))
            with contextlib.suppress(InputError):
                photo_file.decode(bytes(spoiled), generator.choice([1, 8]))


@pytest.mark.parametrize(
    ('start', 'name'),
    [
        (b'\x00\x00\x00\x18ftypheic', 'HEIC'),
        (b'RIFF\x24\x00\x00\x00WEBPVP8 ', 'WebP'),
        (b'II*\x00\x10\x00\x00\x00CR\x02\x00', 'a raw file of a camera'),
        (b'BM\x36\x00', 'BMP'),
    ],
)
def test_another_format_is_named(start: bytes, name: str) -> None:
    with pytest.raises(InputError, match=f'photograph is {name}; set the camera to JPEG'):
        photo_file.photo_size(start + bytes(64))


def test_the_colour_profile_is_read() -> None:
    picture = Image.fromarray(pixels())
    plain, adobe, srgb = io.BytesIO(), io.BytesIO(), io.BytesIO()
    picture.save(plain, 'JPEG')
    tags = Image.Exif()
    tags.get_ifd(0x8769)[0xA005] = {1: 'R03'}
    picture.save(adobe, 'JPEG', exif=tags)
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile('sRGB')).tobytes()
    picture.save(srgb, 'JPEG', icc_profile=profile)
    found = [photo_file.colour_profile(file.getvalue()) for file in (plain, adobe, srgb)]
    assert found == ['sRGB', 'Adobe RGB', 'sRGB']
    assert photo_file.colour_profile(b'nothing') == 'sRGB'
