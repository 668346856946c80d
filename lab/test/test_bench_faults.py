"""The long fault suite."""

from lab.faults import bench_faults


def test_more_work_takes_longer() -> None:
    short = bench_faults.estimate_s(2, 0.5)
    assert 0.0 < short < bench_faults.estimate_s(100, 24.0)


def test_nothing_to_do_is_an_empty_table() -> None:
    assert bench_faults.run(kills=0, hours=0.0) == []
