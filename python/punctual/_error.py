"""The one exception of this package."""


class Error(ValueError):
    """A refusal, with the field, the value and the values allowed; or an FMI call that failed."""
