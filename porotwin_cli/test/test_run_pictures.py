"""Pictures of a closed-loop run."""

from porotwin_cli.run_pictures import shown_minutes


def test_the_times_are_the_papers_or_spread_over_the_run() -> None:
    assert shown_minutes(0.0, 80.0) == [10.0, 35.0, 60.0, 80.0]
    assert shown_minutes(20.0, 50.0) == [20.0, 30.0, 40.0, 50.0]
