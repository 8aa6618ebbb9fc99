"""Numbers that options may have: those beyond are slips of the pen, or would fill the memory."""

_DIGITS = 20


def check_number(option: str, value: int | float | None, least: float, most: float, what: str) -> None:
    """Refuse a number outside of a range, and what is none (NaN).

    Raises:
        ValueError: One line that names the option.
    """
    if value is not None and not least <= value <= most:
        told = f"{value:g}" if isinstance(value, float) else str(value)[:_DIGITS]
        raise ValueError(f"{option} {told}: give {what}, from {least:g} to {most:g}")
