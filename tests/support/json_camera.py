"""One camera, as JSON files have it."""

# A camera 3 m before the origin and 1 m high, which looks along +Y; its lens is 500 px long, its middle at (320, 240).
# Its right is +X and its down is -Z.
R, T = [[1, 0, 0], [0, 0, -1], [0, 1, 0]], [0, 1, 3]


K = [[500, 0, 320], [0, 500, 240], [0, 0, 1]]


LENS = {"K": K, "size": [640, 480]}


BACK = [[1, 0, 0, 0], [0, 0, 1, -3], [0, -1, 0, 1]]
