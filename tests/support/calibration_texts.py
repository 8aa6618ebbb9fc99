"""Calibrations of other tools in XML and text, constructed after their documentation or their readers."""

from pathlib import Path

import cv2
import numpy as np

from support.calibration_files import Format, Rig

# How three people name the parts of a camera that they write with OpenCV's FileStorage.
SPELLINGS = {
    "sample": ("camera_matrix", "distortion_coefficients", "rotation_vectors", "translation_vectors"),
    "words": ("CameraIntrinsicMatrix", "DistortionCoeffs", "CameraRotationVecs", "CameraTranslationVecs"),
    "values": ("CameraMatrix", "DistortionCoeffs", "RotationValues", "TranslationValues"),
    "short": ("mtx", "dist", "rvec", "tvec"),
    "capitals": ("CAMERA_MTX", "Dist_Coeffs", "RVecs", "T_vec"),
}


def _words(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in np.ravel(values))


def _pose(rig: Rig, i: int, unit: float) -> np.ndarray:
    return np.block([[rig.R[i], rig.t[i][:, None] / unit], [np.zeros((1, 3)), np.ones((1, 1))]])


def opencv_xml(folder: Path, rig: Rig, spelling: str = "sample", file_of: str = "{}.xml", size: bool = True) -> Path:
    """Written by OpenCV: a file a camera, side by side or in folders."""
    matrix, lens, turn, shift = SPELLINGS[spelling]
    for i, name in enumerate(rig.names):
        path = folder / file_of.format(name)
        path.parent.mkdir(exist_ok=True)
        file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
        file.write("calibration_time", "Thu 01 Jan 2026 10:00:00")
        if size:
            file.write("image_width", int(rig.size[i, 0]))
            file.write("image_height", int(rig.size[i, 1]))
        file.write(matrix, rig.K[i])
        file.write(lens, rig.dist[i][None])
        file.write(turn, cv2.Rodrigues(rig.R[i])[0])
        file.write(shift, rig.t[i][:, None])
        file.release()
    return folder


def opencv_xml_in_folders(folder: Path, rig: Rig) -> Path:
    # Other files beside them are not cameras.
    board = '<?xml version="1.0"?>\n<opencv_storage>\n<BoardWidth>8</BoardWidth></opencv_storage>\n'
    (folder / "board.xml").write_text(board)
    return opencv_xml(folder, rig, "words", "{}/config.xml", size=False)


def skeletool(folder: Path, rig: Rig) -> Path:
    """4 x 4 matrices by rows, from world to camera, in millimetres."""
    text = "Skeletool Camera Calibration File V1.0\n"
    for i, name in enumerate(rig.names):
        K = np.eye(4)
        K[:3, :3] = rig.K[i]
        text += f"""name          {name}
  sensor      14.1864 10.3776
  size        {rig.size[i, 0]} {rig.size[i, 1]}
  animated    0
  intrinsic   {_words(K)}
  extrinsic   {_words(_pose(rig, i, 0.001))}
  radial      0
"""
    (folder / "camera.calibration").write_text(text)
    return folder / "camera.calibration"


def _elements(rig: Rig, i: int, parts: float, turn: np.ndarray, at: np.ndarray, begin: tuple[float, float]) -> str:
    """The transform and the lens of a camera as Qualisys names them."""
    k1, k2, p1, p2, k3 = rig.dist[i, :5]
    angles = " ".join(f'r{row + 1}{col + 1}="{turn[row, col]}"' for row in range(3) for col in range(3))
    u, v = rig.K[i, :2, 2] + begin
    return f"""<transform x="{at[0]}" y="{at[1]}" z="{at[2]}" {angles}/>
<intrinsic focallength="8" sensorMinU="0" sensorMaxU="SENSOR_U" sensorMinV="0" sensorMaxV="SENSOR_V" skew="0"
 focalLengthU="{parts * rig.K[i, 0, 0]}" focalLengthV="{parts * rig.K[i, 1, 1]}"
 centerPointU="{parts * u}" centerPointV="{parts * v}"
 radialDistortion1="{k1}" radialDistortion2="{k2}" radialDistortion3="{k3}"
 tangentalDistortion1="{p1}" tangentalDistortion2="{p2}"/>"""


def theia3d(folder: Path, rig: Rig) -> Path:
    """From world to camera, in pixels; millimetres."""
    text = '<?xml version="1.0" encoding="UTF-8"?>\n<calibration>\n<cameras>\n'
    for i, name in enumerate(rig.names):
        text += f'<camera active="1" serial="{name}" viewrotation="0" static_boxes="">\n'
        lens = _elements(rig, i, 1.0, rig.R[i], rig.t[i] * 1000, (0, 0))
        text += lens.replace("SENSOR_U", str(rig.size[i, 0])).replace("SENSOR_V", str(rig.size[i, 1])) + "</camera>\n"
    (folder / "Subject_2_calibration.txt").write_text(text + "</cameras></calibration>")
    return folder / "Subject_2_calibration.txt"


def qualisys_sensors(
    folder: Path,
    rig: Rig,
    models: tuple[str, ...] = ("Miqus Video",),
    resolution: str = "1080p",
    margin: int = 0,
    file_name: str = "lab.qca.txt",
    root: str = "{}",
) -> Path:
    """With sensor sizes, larger than the filmed area by a margin; one more camera was not calibrated."""
    text = '<calibration calibrated="true" type="regular">\n<results std-dev="0.2"/>\n<cameras>\n'
    for i, name in enumerate(rig.names):
        turn = rig.R[i] * [[1], [-1], [-1]]
        width, height = rig.size[i]
        whole = f'left="0" top="0" right="{width + 2 * margin - 1}" bottom="{height + 2 * margin - 1}"'
        filmed = f'left="{margin}" top="{margin}" right="{margin + width - 1}" bottom="{margin + height - 1}"'
        lens = _elements(rig, i, 64.0, turn, -rig.R[i].T @ rig.t[i] * 1000, (margin, margin))
        for axis, count in zip("UV", (width, height), strict=True):
            lens = lens.replace(f"SENSOR_{axis}", str(64 * (count + 2 * margin) - 1))
        text += f"""<camera active="1" calibrated="true" message="" avg-residual="0.2" serial="{name}"
 model="{models[i % len(models)]}" viewrotation="0" video_resolution="{resolution}">
<fov_marker {whole}/><fov_marker_max {whole}/><fov_video {filmed}/><fov_video_max {whole}/>
{lens}
</camera>
"""
    text += '<camera active="1" calibrated="false" serial="9" model="Miqus Video"/></cameras></calibration>'
    (folder / file_name).write_text('<?xml version="1.0" encoding="UTF-8"?>\n' + root.format(text))
    return folder / file_name


def qualisys_hybrid(folder: Path, rig: Rig) -> Path:
    return qualisys_sensors(folder, rig, ("Miqus Video", "Miqus Hybrid"), "", margin=8)


def qualisys_1440p(folder: Path, rig: Rig) -> Path:
    return qualisys_sensors(folder, rig, ("Miqus Video Plus",), "1440p")


def qualisys_protocol(folder: Path, rig: Rig) -> Path:
    root = "<QTM_Parameters_Ver_1.21>{}</QTM_Parameters_Ver_1.21>"
    return qualisys_sensors(folder, rig, ("Oqus 300+",), "", 0, "parameters.xml", root)


def biocv(folder: Path, rig: Rig, scale: float = 0.998) -> Path:
    """K (k R | k t): all of the pose times a number."""
    for i, name in enumerate(rig.names):
        pose = _pose(rig, i, 0.001)
        pose[:3] *= scale
        rows = [*rig.size[i], *map(_words, rig.K[i]), "", *map(_words, pose), "", _words(rig.dist[i, :5])]
        (folder / f"{name}.mp4-mocAligned.calib").write_text("\n".join(map(str, rows)) + "\n")
    return folder


def totalcapture(folder: Path, rig: Rig, order: int = 1) -> Path:
    text = f"{len(rig.names)} {order}\n"
    for i, (width, height) in enumerate(rig.size):
        K = rig.K[i]
        text += f"0 {height - 1} 0 {width - 1}\n{_words(K[[0, 1, 0, 1], [0, 1, 2, 2]])}\n"
        text += _words(rig.dist[i, [0, 1, 4][:order]]) + "\n" + "\n".join(map(_words, rig.R[i])) + "\n"
        text += _words(rig.t[i]) + "\n"
    (folder / "calibration.cal").write_text(text)
    return folder / "calibration.cal"


def middlebury(folder: Path, rig: Rig) -> Path:
    lines = [
        f"{name}.png {_words(rig.K[i])} {_words(rig.R[i])} {_words(rig.t[i] / 0.37)}"
        for i, name in enumerate(rig.names)
    ]
    (folder / "temple_par.txt").write_text("\n".join([str(len(lines)), *lines]) + "\n")
    return folder / "temple_par.txt"


def motive(folder: Path, rig: Rig) -> Path:
    """From a camera that looks along -z with y up to a world, by rows; a camera of markers is there too."""
    marker = '<Camera Serial="M1"><Properties CameraID="1" ImagerIndex="00" VideoType="2"/></Camera>'
    text = f'<?xml version="1.0" encoding="UTF-16LE"?>\n<calibrationProfile><Calibration><Cameras>{marker}\n'
    for i, name in enumerate(rig.names):
        turn = (rig.R[i] * [[1], [-1], [-1]]).T.ravel()
        x, y, z = -rig.R[i].T @ rig.t[i]
        k1, k2, p1, p2, k3 = rig.dist[i, :5]
        orient = " ".join(f'OrientMatrix{j}="{number}"' for j, number in enumerate(turn))
        focal = f'HorizontalFocalLength="{rig.K[i, 0, 0]}" VerticalFocalLength="{rig.K[i, 1, 1]}"'
        lens = f'{focal} LensCenterX="{rig.K[i, 0, 2]}" LensCenterY="{rig.K[i, 1, 2]}"'
        text += f"""<Camera Serial="{name}"><Properties CameraID="{i + 2}" ImagerIndex="30" VideoType="6"/>
<Attributes ImagerPixelWidth="{rig.size[i, 0]}" ImagerPixelHeight="{rig.size[i, 1]}"/>
<Intrinsic {lens} k1="7" k2="0" k3="0" TangentialX="0" TangentialY="0"/>
<IntrinsicStandardCameraModel {lens} k1="{k1}" k2="{k2}" k3="{k3}" TangentialX="{p1}" TangentialY="{p2}"/>
<Extrinsic X="{x}" Y="{y}" Z="{z}" {orient}/></Camera>
"""
    (folder / "room.mcal").write_bytes((text + "</Cameras></Calibration></calibrationProfile>").encode("utf-16"))
    return folder / "room.mcal"


def metashape(folder: Path, rig: Rig, placed: bool = True) -> Path:
    """From camera to chunk, and from chunk to world by a similarity; pixels from the corner of the first."""
    scale, shift = (0.37, np.array([1.0, -2.0, 0.5])) if placed else (1.0, np.zeros(3))
    turn = cv2.Rodrigues(np.array([0.3, -0.5, 0.2]))[0] if placed else np.eye(3)
    sensors = cameras = ""
    for i, name in enumerate(rig.names):
        (width, height), K, (k1, k2, p1, p2, k3) = rig.size[i], rig.K[i], rig.dist[i, :5]
        pose = np.eye(4)
        pose[:3, :3] = turn.T @ rig.R[i].T
        pose[:3, 3] = turn.T @ (-rig.R[i].T @ rig.t[i] - shift) / scale
        cx, cy = K[:2, 2] + 0.5 - rig.size[i] / 2
        sensors += f"""<sensor id="{i}" label="x" type="frame"><resolution width="{width}" height="{height}"/>
<calibration type="frame" class="initial"><f>1</f></calibration>
<calibration type="frame" class="adjusted"><resolution width="{width}" height="{height}"/><f>{K[1, 1]}</f>
<cx>{cx}</cx><cy>{cy}</cy><b1>{K[0, 0] - K[1, 1]}</b1>
<k1>{k1}</k1><k2>{k2}</k2><k3>{k3}</k3><p1>{p2}</p1><p2>{p1}</p2></calibration></sensor>
"""
        cameras += (
            f'<camera id="{i}" sensor_id="{i}" label="{name}.JPG" enabled="1"><transform>{_words(pose)}</transform>'
        )
        cameras += "</camera>\n"
    place = f"<rotation>{_words(turn)}</rotation><translation>{_words(shift)}</translation><scale>{scale}</scale>"
    place = f"<transform>{place}</transform>" if placed else ""
    lost = '<camera id="99" sensor_id="0" label="not aligned"/>'
    (folder / "cameras.xml").write_text(f"""<?xml version="1.0" encoding="UTF-8"?>
<document version="1.2.0"><chunk><sensors>{sensors}</sensors><cameras>{lost}<group>{cameras}</group></cameras>{place}
</chunk></document>""")
    return folder / "cameras.xml"


def kalibr(folder: Path, rig: Rig) -> Path:
    """Each camera but the first is placed by the one before it."""
    text = ""
    for i in range(len(rig.names)):
        K = rig.K[i]
        text += f"cam{i}:\n  cam_overlaps: [0, 1]\n  camera_model: pinhole\n"
        text += f"  distortion_coeffs: {rig.dist[i, :4].tolist()}\n  distortion_model: radtan\n"
        text += f"  intrinsics: {K[[0, 1, 0, 1], [0, 1, 2, 2]].tolist()}\n  resolution: {rig.size[i].tolist()}\n"
        text += f"  rostopic: /cam{i}/image_raw\n"
        if i:
            step = _pose(rig, i, 1.0) @ np.linalg.inv(_pose(rig, i - 1, 1.0))
            text += "  T_cn_cnm1:\n" + "".join(f"  - {row}\n" for row in step.tolist())
    (folder / "camchain.yaml").write_text(text)
    return folder / "camchain.yaml"


def opencv_json(folder: Path, rig: Rig) -> Path:
    return opencv_xml(folder, rig, "words", "{}.json")


TEXT_FORMATS = {
    "opencv xml": Format(opencv_xml, 8, "OpenCV XML", None),
    "opencv json": Format(opencv_json, 8, "OpenCV JSON", None),
    "opencv xml in folders": Format(opencv_xml_in_folders, 8, "OpenCV XML", None, has_size=False),
    "skeletool": Format(skeletool, 0, "Skeletool", None),
    "theia3d": Format(theia3d, 5, "Theia3D", None),
    "qualisys hybrid": Format(qualisys_hybrid, 5, "Qualisys", "+Z"),
    "qualisys 1440p": Format(qualisys_1440p, 5, "Qualisys", "+Z"),
    "qualisys protocol": Format(qualisys_protocol, 5, "Qualisys", "+Z"),
    "biocv": Format(biocv, 5, "BioCV", "+Z"),
    "middlebury": Format(middlebury, 0, "Middlebury par", None, unit=0.37, has_size=False),
    "motive": Format(motive, 5, "Motive", "+Y"),
    "metashape": Format(metashape, 5, "Metashape", None),
}
# Their cameras have no names of their own.
NUMBERED_FORMATS = {
    "totalcapture": Format(totalcapture, 1, "TotalCapture", None),
    "kalibr": Format(kalibr, 4, "Kalibr", None),
}
