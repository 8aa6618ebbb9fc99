"""A term whose residuals are made robust."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from ..._runtime.kinds import check_count, check_kind
from ._base import AbstractTerm, Observed, PlacedBody
from ._losses import AbstractLoss, robust_rows
from ._quadrics import CapsuleTerm


class Robust(AbstractTerm):
    """Another term with a robust loss of its residuals instead of their squares.

    The squared norm of its residual is the robust cost, and the Jacobian is that of this cost, for any solver. The
    weight is that of the other term.

    Attributes:
        loss: Its scale is in the unit of the term's residuals.
        group: How many residuals in a row are one vector, whose length the loss is of: 3 for positions (x, y, z).

    Raises:
        ValueError: One line. The term is no term of single frames, or sums up its points to quadrics (a `CapsuleTerm`):
            these have no residual for each point. `ContourContact` takes a loss itself.
    """

    term: AbstractTerm
    loss: AbstractLoss
    group: int = eqx.field(static=True)

    def __init__(self, term: AbstractTerm, loss: AbstractLoss, group: int = 1):
        """Reject what cannot be made robust."""
        check_kind("term", term, AbstractTerm, "a term of single frames, such as EndNodeAttraction()")
        check_kind("loss", loss, AbstractLoss, "a loss, such as GemanMcClure(0.05)")
        check_count("group", group)
        if isinstance(term, CapsuleTerm):
            raise ValueError(
                f"term: {type(term).__name__} sums up its points, so it has no residual for each; give the loss to it, "
                "ContourContact(body, loss=...), or weight the points in your own quadrics"
            )
        self.term, self.loss, self.group = term, loss, group

    @property
    def weight(self) -> Any:  # a placeholder while another weight is put in
        """Weight of the term."""
        return self.term.weight

    @property
    def needs_graph(self) -> bool:
        """Whether the term uses the labelled graph."""
        return self.term.needs_graph

    @property
    def needs_outlines(self) -> bool:
        """Whether the term uses the outlines."""
        return self.term.needs_outlines

    def correspond(self, body: PlacedBody, observed: Observed) -> PyTree:
        """What the term looks up."""
        return self.term.correspond(body, observed)

    def residual(self, body: PlacedBody, observed: Observed, fixed: Any) -> Float[Array, " rows"]:
        """Residuals whose squared norm is the robust cost.

        Raises:
            ValueError: The number of the term's residuals is no multiple of `group`.
        """
        plain = jnp.ravel(self.term.residual(body, observed, fixed))
        if plain.size % self.group:
            raise ValueError(f"group: is {self.group}, but the term has {plain.size} residuals; give a divisor of that")
        return robust_rows(self.loss, plain.reshape(-1, self.group)).ravel()
