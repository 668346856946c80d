"""Repeated remarks get one line."""

from porotwin_imaging.numerics.repeated_remarks import lines_of_remarks


def test_remarks_that_differ_by_numbers_get_one_line() -> None:
    remarks = [(60.0 * n, f'{n}.5 % of the sand is dark') for n in range(1, 5)]
    remarks.insert(1, (90.0, 'hazy by 3 %'))
    assert lines_of_remarks(remarks, 20) == [
        '4 of 20 photographs, the first at 60 s: 1.5 % of the sand is dark',
        'photograph at 90 s: hazy by 3 %',
    ]
    assert lines_of_remarks([], 20) == []
