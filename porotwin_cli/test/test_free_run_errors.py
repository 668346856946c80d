"""The errors of a free run in words."""

from porotwin_cli.recorded.free_run_errors import FreeRunErrors


def test_a_free_run_without_the_tracer_of_the_first_map_is_told() -> None:
    errors = FreeRunErrors(0.7, 0.68, 0.6, 0.04)
    assert 'first map' not in str(errors)
    lacking = FreeRunErrors(0.7, 0.68, 0.6, 0.04, lacks_start=True)
    assert str(lacking).startswith(str(errors))
    assert 'these errors say nothing about the model' in str(lacking)
