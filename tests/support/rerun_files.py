"""The contents of a viewer file."""

from support.report_page import FRAMES


def read(path) -> dict:
    """Logged values of every component, by entity and name, then by frame; by None if they hold for all frames."""
    from rerun.chunk import RrdReader

    found: dict = {}
    for chunk in RrdReader(path).stream().to_chunks():
        batch = chunk.to_record_batch()
        columns = dict(zip(batch.schema.names, batch.columns, strict=True))
        frames = [None] * batch.num_rows if chunk.is_static else columns["frame"].to_pylist()
        for name in columns.keys() - {"log_time"}:  # which has nanoseconds
            of = found.setdefault((chunk.entity_path, name.split(":")[-1]), {})
            for frame, value in zip(frames, columns[name].to_pylist(), strict=True):
                assert frame is None or frame not in of
                of[frame] = value
    return found


def every_frame(found: dict, entity: str, name: str) -> list:
    of = found[entity, name]
    assert sorted(of) == list(range(100, 100 + FRAMES))
    return [of[100 + i] for i in range(FRAMES)]
