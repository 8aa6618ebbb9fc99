"""Settings of the reconstruction: everything a user may choose, in one object."""

import equinox as eqx
import numpy as np
from jaxtyping import Float

from .._runtime.kinds import check_count, check_kind, check_number
from ..body import HUMAN_15, Body, Skeleton, default_adult, make_body
from ..graph import MIN_BRANCH, GeodesicShells, HeadBall, HighestVoxel, RootFinder, Skeletoniser, VoxelScooping
from ..hull import check_spacing
from ..matching import HANDLESS_DESCRIPTOR, PAPER_DESCRIPTOR, DtwMatcher, ExactMatcher, Matcher
from ..refinement import Solver, check_choices
from ..refinement.parametrisations import ExactBones, HingedLimbs, Parametrisation
from ..refinement.solvers import NormalEquationsLM, default_solver
from ..refinement.terms import GivenObjective, Objective, check_given, objective_of, paper_objective, volume_objective
from ..search import Search, Tracking, prior_in_clothes

# Shortest branch of other templates (m, for a body of a person's size): a finger of a hand that is as large has 0.5 m.
_SHORT_BRANCH = 0.18

# Weight of priors of poses along a track of a naked person. Of the hands of 15 films (crowd, and p10 to p15 in other
# clips with four cameras), 0.7 % were wrong with 0, 0.3 % with 0.3 and 0.5 % with 0.5. In clothes, three draws for each
# of nine of these films, 5.5, 5.7 and 5.4 %; and of a heavy body whose arm long hair may explain, 47, 2 and 1 %.
_ALONG_A_TRACK = 0.3


class HullSettings(eqx.Module):
    """How the visual hull is carved (Sect. 3.1).

    Attributes:
        spacing: Edge length of a voxel (m). With 10, 15, 20 and 30 mm the median error is 9.5, 9.4, 9.4 and 9.5 mm on
            three test sequences, because the silhouettes decide between the graph's poses: see
            `benchmarks/defaults.py`.
        box: Lower and upper corner of what to carve, in the recording's world (m); by default around the person.
        min_views: Cameras that must see a voxel for it to be occupied; by default 3, or 2 with fewer than six cameras.
        max_misses: k-of-n voting: the number of cameras that may see background at an occupied voxel; by default chosen
            from the silhouettes.
    """

    spacing: float = 0.015
    box: Float[np.ndarray, "2 3"] | None = None
    min_views: int | None = None
    max_misses: int | None = None

    def __check_init__(self):
        """Reject numbers that make no sense."""
        check_spacing(self.spacing)
        if self.box is not None and np.shape(self.box) != (2, 3):
            raise ValueError(f"box: has shape {np.shape(self.box)}; give the lower and the upper corner, (2, 3)")
        for name, count, least in (("min_views", self.min_views, 1), ("max_misses", self.max_misses, 0)):
            if count is not None:
                check_count(name, count, least)


class GraphSettings(eqx.Module):
    """How the skeletal graph is extracted from the hull (Sect. 3.1).

    Attributes:
        skeletoniser: Extracts the curve skeleton. On the twenty test sequences, the labelled graph alone gets 18.2 % of
            the hands and 0.1 % of the feet wrong with `GeodesicShells`, 22.7 and 0.4 % with the paper's
            `VoxelScooping`, and 16.5 and 0.5 % with `ThinnestPaths`, which take 25 times as long: see
            `benchmarks/defaults.py`.
        root_finder: Finds where the graph starts: at the sphere of the head, or, as in the paper, at the
            `HighestVoxel`.
        min_branch: Branches of the graph shorter than this are pruned (m). With 0.16, 0.20 and 0.24 m, 18.8, 18.2 and
            21.8 % of the hands are wrong there.
    """

    skeletoniser: Skeletoniser = GeodesicShells()
    root_finder: RootFinder = HeadBall()
    min_branch: float = MIN_BRANCH

    def __check_init__(self):
        """Reject classes for instances, and millimetres."""
        check_kind("skeletoniser", self.skeletoniser, Skeletoniser, "one, such as GeodesicShells()")
        check_kind("root_finder", self.root_finder, RootFinder, "one, such as HeadBall()")
        check_number("min_branch", self.min_branch, 0.0, 2.0, "a length in metres, such as 0.24")


class MatchingSettings(eqx.Module):
    """How the end nodes of the graph are labelled (Sect. 3.2).

    Attributes:
        matcher: Assigns end nodes to limbs: by DTW, as in the paper, or by an `ExactMatcher`.
        descriptor: Labels whose geodesic distances describe neck and pelvis (Eq. 5). Without hands, and with them as in
            the paper, the labelled graph alone has a median error of 32 and 48 mm on the twenty test sequences, and
            19.4 and 18.2 % of the hands wrong: see `benchmarks/defaults.py`.
    """

    matcher: Matcher = DtwMatcher()
    descriptor: tuple[int, ...] = HANDLESS_DESCRIPTOR

    def __check_init__(self):
        """Reject classes for instances, and labels that there are not."""
        check_kind("matcher", self.matcher, Matcher, "one, such as DtwMatcher()")
        if not self.descriptor or not set(self.descriptor) <= set(PAPER_DESCRIPTOR):
            raise ValueError(f"descriptor: is {self.descriptor!r}; give some labels of {PAPER_DESCRIPTOR}")


class RefinementSettings(eqx.Module):
    """How the pose is refined (Sect. 3.3).

    Attributes:
        objective: What is minimised: an objective, or a function that makes one for the subject's body. With terms that
            couple frames, frames that follow one another are refined together.
        parametrisation: How a pose is expressed by unknowns.
        solver: Solves for the unknowns. For coupled frames, `default_solver` works on a band of blocks, as
            `sequence_solver` does; another solver must be matrix-free.
        rounds: Number of times that correspondences are looked up. With 1, 2 and 3 the median error is 9.5, 9.4 and 9.4
            mm on three test sequences: see `benchmarks/defaults.py`.
        max_steps: Largest number of steps of the solver in each round. With 4, 8 and 16 the median error is 9.4 mm on
            three test sequences: the search starts the solver near the solution. Other objectives may need more.
    """

    objective: GivenObjective = volume_objective
    parametrisation: Parametrisation = HingedLimbs()
    solver: Solver = eqx.field(default_factory=default_solver)
    rounds: int = 1
    max_steps: int = 16

    def __check_init__(self):
        """Reject what no refinement can work with."""
        check_given(self.objective)
        check_choices(self.parametrisation, self.solver, self.rounds, self.max_steps)

    def objective_for(self, body: Body) -> Objective:
        """The objective for a subject."""
        return objective_of(self.objective, body)


class Settings(eqx.Module):
    """How to reconstruct, stage by stage.

    By default the graph proposes poses and the silhouettes decide between them, see `Search`.

    Attributes:
        search: Finds the poses to refine from the silhouettes; if None, the labelled graph gives the pose.
        tracking: Tracks the person from frame to frame instead of searching in every frame; needs a search.
        body: The subject's body if it was calibrated before; by default it is calibrated on the recording.
        template: What skeleton to find, at any size, such as `read_template` reads it; by default the paper's human. A
            search finds the human body and puts the template's points on it; without one, the template itself is
            matched with the graph. Lengths of the other settings are then for a body of a person's size.

    Raises:
        ValueError: A combination that cannot work.
    """

    hull: HullSettings = HullSettings()
    graph: GraphSettings = GraphSettings()
    matching: MatchingSettings = MatchingSettings()
    search: Search | None = Search()
    tracking: Tracking | None = None
    body: Body | None = None
    refinement: RefinementSettings = eqx.field(default_factory=RefinementSettings)
    template: Skeleton | None = None

    def __check_init__(self):
        """Reject combinations that cannot work."""
        check_kind("template", self.template, Skeleton | None, "a Skeleton, as read_template(path) reads it, or None")
        if self.search is not None and self.template is not None and not self.template.template.is_human:
            raise ValueError(
                f"template: {self.template.template.name!r} has points that are not on the human body, which a search "
                "needs; give paper_settings(template), or say in its file what each point is"
            )
        check_kind("hull", self.hull, HullSettings, "HullSettings(...)")
        check_kind("graph", self.graph, GraphSettings, "GraphSettings(...)")
        check_kind("matching", self.matching, MatchingSettings, "MatchingSettings(...)")
        check_kind("search", self.search, Search | None, "Search(...) or None")
        check_kind("tracking", self.tracking, Tracking | None, "Tracking(...) or None")
        check_kind("body", self.body, Body | None, "a Body, such as make_body(skeleton), or None")
        check_kind("refinement", self.refinement, RefinementSettings, "RefinementSettings(...)")
        if self.search is not None:
            return
        if self.tracking is not None:
            raise ValueError("tracking needs a search to start from: give Settings(search=Search()), or no tracking")
        if self.usual_objective().needs_outlines:
            raise ValueError(
                "without a search only the graph is looked at, but the objective needs outlines: give "
                "Settings(search=Search()), or paper_objective()"
            )

    @property
    def average(self) -> Skeleton:
        """The skeleton that is matched with the graph before anything is known of the subject."""
        return default_adult() if self.search is not None or self.template is None else self.template

    def usual_objective(self) -> Objective:
        """The refinement's objective for the body, or an average one: its terms do not depend on who somebody is."""
        return self.refinement.objective_for(self.body or make_body(self.average))


def weight_of_priors(settings: Settings, clothes: float) -> float:
    """How many times as much priors of poses count for a subject in clothes of that thickness (m).

    Along a track they count less, because arms that are held in an unusual way over many frames are the same surprise
    in each of them: `_ALONG_A_TRACK`, and what clothes add.
    """
    prior = prior_in_clothes(clothes)
    return prior - 1.0 + _ALONG_A_TRACK if settings.tracking is not None else prior


def paper_settings(template: Skeleton | None = None) -> Settings:
    """The paper's method as published, for its human template or another one.

    The graph is made of shells of equal distance instead of by voxel scooping: `VoxelScooping` takes twice as long for
    one frame, and gets more hands wrong. The head is the highest voxel, Eq. 5 describes inner nodes by all end nodes,
    every view carves, and the pose of the labelled graph is refined against the graph with fixed bone lengths.
    Correspondences are looked up often: that lowers the error more than the last percent of the cost does.

    Limbs of another template may be shorter, and more of them equally long: shorter branches are kept, and the matcher
    is the exact one. Of three times 50 random poses, 99.9 % of a quadruped's end nodes and 97.9 % of a hand's get the
    right label; with DTW, of 50, 96.7 % each: see `benchmarks/templates.py`. Their graphs are scooped: joints are off
    by 1.9 % of the size, with shells by 3 %.
    """
    other = template is not None and template.template != HUMAN_15
    return Settings(
        hull=HullSettings(max_misses=0),
        graph=GraphSettings(
            VoxelScooping() if other else GeodesicShells(), HighestVoxel(), _SHORT_BRANCH if other else MIN_BRANCH
        ),
        matching=MatchingSettings(
            matcher=ExactMatcher() if other else DtwMatcher(), descriptor=PAPER_DESCRIPTOR
        ),
        search=None,
        refinement=RefinementSettings(
            objective=paper_objective(), parametrisation=ExactBones(),
            solver=NormalEquationsLM(rtol=1e-2, atol=3e-3, ftol=1e-2), rounds=5,
        ),
        template=template,
    )  # fmt: skip
