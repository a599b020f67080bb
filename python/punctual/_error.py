"""The one exception of this package."""


class Error(ValueError):
    """What was refused, with the field, the value and what is allowed; or an FMI call that failed."""
