"""What a folder without a `recording.toml` may be: its views, its calibration, and which camera is which view."""

import re
from dataclasses import dataclass
from pathlib import Path

from ._archive import fault
from ._view_table import open_frames
from .calibrations import Contents, contents_of
from .folders import RECORDING_FILE
from .view_sets import ViewSet, find_view_sets
from .views import Frames, rule_of


@dataclass(frozen=True)
class Proposal:
    """A `recording.toml`, and what a person should look at in it."""

    text: str
    doubts: tuple[str, ...]
    """Where it had to choose."""


def propose_recording(
    folder: Path, views: str | None = None, calibration: str | None = None, fps: float | None = None
) -> Proposal:
    """Write down what a folder seems to hold.

    Args:
        folder: The folder.
        views: Pattern of the views' files or folders relative to it, ``masks/*``, where there are several sets.
        calibration: File of the calibration relative to it, where there are several.
        fps: Frames per second, where no video says it.

    Raises:
        ValueError: One line, where there is no calibration, or no set of views, or nothing says which of several it is.
    """
    source, contents, doubts = _calibration(folder, calibration)
    names = [camera.name for camera in contents.entries]
    chosen, others = _views(folder, views, names)
    frames = {
        name: open_frames(folder / RECORDING_FILE, f"views.{name}", text) for name, text in chosen.sources.items()
    }
    cameras, by_order = match_names(list(frames), names)
    if by_order:
        doubts.append(f"views and cameras have no names in common: taken in order, {_pairs(cameras)}")
    rate = fps if fps is not None else _rate(folder, frames)
    up = contents.up
    if contents.unposed:
        doubts.append(f"{source}: {', '.join(contents.unposed)} without a pose, left out")
    if up is None:
        doubts.append(f"{source} does not say which axis points up: +Z is written")
    lines = ["# Written by `jaxskel init`. What it had to choose says so; `jaxskel check` draws what comes of it.", ""]
    lines += [f"fps = {rate:.10g}", f"calibration = {_quoted(source)}"]
    if contents.unit is None:
        doubts.append(f"{source} has no scale, unit = 1 is written: {contents.scale_is}")
        lines += ["unit = 1.0  # CHECK: metres per unit of the calibration, which has no scale"]
    lines += [f'up = "{up}"' if up is not None else 'up = "+Z"  # CHECK: the calibration does not say it']
    spans = [view.span for view in frames.values()]
    if len(set(spans)) > 1:
        first, last = max(span[0] for span in spans), min(span[1] for span in spans)
        doubts.append(f"views have different numbers of frames: {first} to {last} are those of all")
        lines += [f"frames = [{first}, {last}]  # CHECK: those that all views have; is frame {first} the same moment?"]
    if (folder / "subject.toml").is_file():
        lines += ['subject = "subject.toml"']
    else:
        lines += ['# subject = "subject.toml"  # the subject\'s stature and lengths, if known']
    sizes = {camera.name: camera.size for camera in contents.entries}
    for name, view in frames.items():
        lines += ["", f"[views.{_quoted(name) if re.search(r'[^A-Za-z0-9_-]', name) else name}]"]
        lines += _view_lines(name, chosen.sources[name], view, others, doubts)
        if cameras[name] != name:
            lines += [f"camera = {_quoted(cameras[name])}" + ("  # CHECK: taken in order" if by_order else "")]
        size = sizes[cameras[name]]
        if size is not None and size != view.size:
            (width, height), (w, h) = view.size, size
            doubts.append(f"{name}: images are {width} x {height} px, calibrated are {w:g} x {h:g}")
            lines += [f"calibrated_size = [{w:g}, {h:g}]  # CHECK: images are {width} x {height}: no pixel moved?"]
    return Proposal("\n".join(lines) + "\n", tuple(doubts))


def match_names(views: list[str], cameras: list[str]) -> tuple[dict[str, str], bool]:
    """The camera of each view, by names that differ in case, signs and leading zeros only, or by their numbers.

    Returns:
        The cameras, and whether nothing but the order told which is which.

    Raises:
        ValueError: One line, where there are more views than cameras, or only some names match.
    """
    for key in (_plain, _digits):
        known = {key(camera): camera for camera in cameras}
        wanted = [key(view) for view in views]
        if len(known) == len(cameras) and len(set(wanted)) == len(views) and set(wanted) <= set(known) - {""}:
            return {view: known[name] for view, name in zip(views, wanted, strict=True)}, False
    if len(views) == len(cameras):
        return dict(zip(views, cameras, strict=True)), True
    raise ValueError(
        f"views {', '.join(views)} and cameras {', '.join(cameras)} have neither names nor their number in common; "
        f"write {RECORDING_FILE} by hand"
    )


def _plain(name: str) -> str:
    return re.sub(r"0*(\d+)", r"\1", re.sub(r"[^a-z0-9]", "", name.lower()))


def _digits(name: str) -> str:
    return " ".join(digits.lstrip("0") or "0" for digits in re.findall(r"\d+", name))


def _calibration(folder: Path, wanted: str | None) -> tuple[str, Contents, list[str]]:
    """The calibration's path relative to the folder, what it holds, and what there was to choose."""
    if wanted is not None:
        return wanted, contents_of(folder / wanted), []
    found: dict[str, Contents] = {}
    for path in sorted((folder, *folder.iterdir(), *folder.glob("*/*"))):
        if path.name in (RECORDING_FILE, "subject.toml") or path.is_dir() and not _may_be_calibration(path):
            continue
        try:
            contents = contents_of(path)
        except ValueError:
            continue
        if len(contents.entries) > 1:
            found[path.relative_to(folder).as_posix()] = contents
    if not found:
        raise fault(folder, None, "holds no calibration that can be read; name it by --calibration to see why")
    # Those nearest to the top, and of those TOML: it is what people edit.
    order = sorted(found, key=lambda text: (text.count("/"), not text.endswith(".toml"), text))
    doubts = [f"calibrations {', '.join(order)}: the first is taken"] if len(order) > 1 else []
    return order[0], found[order[0]], doubts


def _may_be_calibration(folder: Path) -> bool:
    """A folder is one where its files belong together."""
    names = [file.name.lower() for file in folder.iterdir()]
    alike = (".yml", ".yaml", ".xml", ".json", ".calib")
    return any(name == "cameras.txt" or name.endswith(alike) for name in names) or any(folder.glob("*/*.xml"))


def _views(folder: Path, pattern: str | None, cameras: list[str]) -> tuple[ViewSet, list[ViewSet]]:
    """The set of views that goes with the cameras, and the others."""
    sets = find_view_sets(folder)
    if pattern is not None:
        fitting = [found for found in sets if found.pattern == pattern]
        if not fitting:
            raise fault(folder, None, f"--views {pattern}: there are {_listed(sets)}")
        return fitting[0], [found for found in sets if found is not fitting[0]]
    fitting = [found for found in sets if not found.is_accessory and _fits(found, cameras)]
    fitting = [found for found in fitting if not match_names(list(found.sources), cameras)[1]] or fitting
    best = [found for found in fitting if found.is_of_masks] or fitting
    if not best:
        raise fault(folder, None, f"holds no view for each of {', '.join(cameras)}; there are {_listed(sets)}")
    if len(best) > 1:
        raise fault(folder, None, f"holds several sets of views, {_listed(best)}; choose by --views PATTERN")
    return best[0], [found for found in sets if found is not best[0]]


def _fits(found: ViewSet, cameras: list[str]) -> bool:
    try:
        match_names(list(found.sources), cameras)
    except ValueError:
        return False
    return True


def _listed(sets: list[ViewSet]) -> str:
    return ", ".join(f"{found.pattern} ({', '.join(found.sources)})" for found in sets) or "no images, videos or masks"


def _pairs(cameras: dict[str, str]) -> str:
    return ", ".join(f"{view} = {camera}" for view, camera in cameras.items())


def _rate(folder: Path, frames: dict[str, Frames]) -> float:
    rates = {name: view.fps for name, view in frames.items()}
    known = {rate for rate in rates.values() if rate is not None}
    if not known:
        raise fault(folder, None, "nothing says how many frames a second there are; give --fps")
    if max(known) > 1.001 * min(known) or None in rates.values():
        told = ", ".join(f"{name} {rate}" for name, rate in rates.items())
        raise fault(folder, None, f"views have different rates ({told}); give the recording's by --fps")
    return max(known)


def _view_lines(name: str, text: str, view: Frames, others: list[ViewSet], doubts: list[str]) -> list[str]:
    """What a view's images are: masks, or in colour with what there is for a background."""
    doubts += [f"{name}: {note}" for note in view.notes]
    rule = rule_of(view)
    if not rule.is_picture:
        lines = rule.lines()
        doubts += [f"{name}: {rule.told}"] if rule.told else []
        return [f"masks = {_quoted(text)}", *lines]
    plate = next((found.sources[name] for found in others if found.is_background and name in found.sources), None)
    if plate is not None:
        return [f"images = {_quoted(text)}", f"plate = {_quoted(plate)}"]
    doubts.append(
        f"{name}: images are in colour and there is no film of the empty scene: a median over time is written"
    )
    return [
        f"images = {_quoted(text)}",
        "median = true  # CHECK: or plate = FILE of the empty scene, or backdrop = true",
    ]


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
