"""A process of its own that decomposes one mesh: run as a file with the paths of an order and of an answer (.npz)."""

import sys

import numpy as np


def main(order: str, answer: str) -> None:
    """Read vertices, faces and parameters from the order; write the corners (K, 3) of each piece as the answer."""
    import coacd

    coacd.set_log_level("error")
    with np.load(order) as given:
        mesh = coacd.Mesh(given["vertices"], given["faces"])
        concavity, most, corners = given["numbers"].tolist()
    parts = coacd.run_coacd(
        mesh, threshold=concavity, max_convex_hull=int(most), max_ch_vertex=int(corners), decimate=True, seed=0
    )
    corners_of = {str(i): np.asarray(vertices, dtype=float) for i, (vertices, _) in enumerate(parts)}
    np.savez(answer, allow_pickle=False, **corners_of)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
