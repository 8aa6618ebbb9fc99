"""Derives names of cameras from the names of their images."""

from pathlib import Path, PurePosixPath

from ..files import fault


def names_of_images(path: Path, files: list[str]) -> list[str]:
    """The name of each image without its suffix, or that of its folder if every folder holds one image."""
    paths = [PurePosixPath(file.strip().replace("\\", "/")) for file in files]
    stems, folders = [p.stem for p in paths], [p.parent.name for p in paths]
    for names in (stems, folders):
        if len(set(names)) == len(names) and all(names):
            return names
    raise fault(
        path,
        None,
        "holds several images of one camera; export a model with one image a camera, named after it (cam1.png or "
        "cam1/0001.png)",
    )
