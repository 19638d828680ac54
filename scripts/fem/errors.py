"""Errors that a user can cause; the entry point prints them without a traceback."""


class ParameterError(ValueError):
    """A parameter that cannot be used; the message names the key and says what is expected."""


class ModelError(RuntimeError):
    """A model that parameters allow but that cannot be solved or does not pass its own checks."""
