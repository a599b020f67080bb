"""The exception and the warning of this package."""


class Error(ValueError):
    """A refusal, with the field, the value and the values allowed; or an FMI call that failed."""


class GuaranteeWarning(UserWarning):
    """A filter follows no plans, so that nothing is guaranteed, though every input has bounds: the text names what in the
    configuration switches them off. `assurance = "on"` makes an error of it, `assurance = "off"` accepts it."""
