"""Checks ranges of numeric options: values beyond are typing errors, or would fill the memory."""

_DIGITS = 20


def check_number(option: str, value: int | float | None, least: float, most: float, what: str) -> None:
    """Refuse a number outside of a range, or NaN; None is accepted.

    Raises:
        ValueError: One line that names the option.
    """
    if value is not None and not least <= value <= most:
        told = f"{value:g}" if isinstance(value, float) else str(value)[:_DIGITS]
        raise ValueError(f"{option} {told}: give {what}, from {least:g} to {most:g}")
