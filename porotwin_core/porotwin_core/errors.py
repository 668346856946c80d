"""The one error that a user is meant to read."""


class InputError(ValueError):
    """Something given to the twin is wrong: a file, a value, a name, a message.

    The message is one line that names the thing, its value and what would mend it. Commands print
    it and exit with status 2; nodes log it and go on.
    """
