"""Imports the viewer's package rerun, an optional dependency."""

try:
    # Large and needed for nothing else, so it may be missing.
    import rerun as rr  # pyright: ignore[reportMissingImports]
    import rerun.blueprint as rrb  # pyright: ignore[reportMissingImports]
except ImportError as error:
    raise ImportError('the 3D view needs rerun, which is missing: pip install "jaxskel[view]"') from error

__all__ = ["rr", "rrb"]
