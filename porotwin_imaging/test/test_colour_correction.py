"""The correction of colours and light by the chart."""

from porotwin_imaging.baseline.baseline import make_baseline
from porotwin_imaging.photo_to_map import concentration_map


def test_with_a_chart_that_is_dark_in_one_channel_the_sand_gives_the_light(
    laboratory, calibration, no_tracer, true_map, make_jpeg, relative_error
) -> None:
    pictures = [laboratory.scene(c) for c in (no_tracer, true_map)]
    for light in pictures:
        light[:130, :, 2] *= 0.05  # blue of the chart, above the sand
    before, after = (make_jpeg(light, noise=0.0) for light in pictures)
    rig = laboratory.rig
    baseline = make_baseline(rig, rig.grid(90, 50), [before], calibration=calibration)
    found = concentration_map(after, baseline)
    assert any('light is judged by the sand alone' in line for line in found.status)
    assert relative_error(found.values, true_map) < 0.05


def test_a_chart_far_from_its_place_says_that_the_camera_moved(
    laboratory, calibration, no_tracer, make_jpeg
) -> None:
    rig, photo = laboratory.rig, make_jpeg(laboratory.scene(no_tracer))
    chart = [(x + 15.0, y + 10.0) for x, y in rig.camera.colour_checker_px]
    camera = rig.camera.model_copy(update={'colour_checker_px': tuple(chart)})
    moved = rig.model_copy(update={'camera': camera})
    remarks = {
        name: ' '.join(
            make_baseline(one, one.grid(90, 50), [photo], calibration=calibration).remarks
        )
        for name, one in (('right', rig), ('moved', moved))
    }
    assert 'mark camera.corners_px' in remarks['moved']
    assert 'mark camera.corners_px' not in remarks['right']
