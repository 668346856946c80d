"""The error of wrong input, the only one that a user is meant to read."""


class InputError(ValueError):
    """A file, value, name or message given to the twin is wrong.

    The message is one line with the thing, its value and the remedy. Commands print it and exit
    with status 2; nodes log it and go on.
    """
