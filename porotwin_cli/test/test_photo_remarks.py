"""Remarks about photographs are told, but do not fill the screen."""

from porotwin_cli.photographs.photo_remarks import PhotoRemarks
from porotwin_core.ros.foreign_words import FEW


def test_the_first_remarks_are_told_and_the_others_are_counted():
    lines: list[str] = []
    remarks = PhotoRemarks(lines.append)
    for number in range(FEW + 5):
        remarks.tell(f'{number}.jpg', ['19 % of the sand is covered'])
        remarks.tell('good.jpg', [])
    remarks.tell('last.jpg', ['one', 'two'])
    remarks.tell_the_rest()
    assert lines[0] == '0.jpg: 19 % of the sand is covered'
    assert len(lines) == FEW + 1
    assert lines[-1] == '7 more remarks about 6 photographs; --json lists them all'


def test_without_more_remarks_nothing_is_added():
    lines: list[str] = []
    remarks = PhotoRemarks(lines.append)
    remarks.tell('a.jpg', ['one'])
    remarks.tell_the_rest()
    assert lines == ['a.jpg: one']
