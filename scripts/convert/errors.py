"""What can be wrong with an input; every message names the file, the object, what was found, what was expected and what to do."""


class InputError(ValueError):
    """An input that cannot be used."""

    def __init__(self, file, place, found, expected, remedy):
        super().__init__(f"{file}: {place}: found {found}, expected {expected}; {remedy}")
