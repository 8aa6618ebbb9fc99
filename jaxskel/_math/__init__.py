"""Mathematics without people: rotations, connected components."""
