"""Mathematics that is not specific to bodies: rotations, connected components."""
