"""An object set may have thousands of meshes, each of which a process keeps a ray tree of."""

import subprocess
import sys

PROGRAM = """
import numpy as np
from bayesgrasp.depth.mesh_tree import MeshTree
corners, faces = np.vstack([np.zeros(3), np.eye(3)]), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
trees = [MeshTree(corners, faces) for _ in range(4000)]
ray = np.array([[0.2, 0.2, -1.0]], np.float32), np.array([[0.0, 0.0, 1.0]], np.float32)
print(sum(int(tree.first_hit(*ray)[0]) == 0 for tree in trees))
"""


def test_thousands_of_trees_live_in_one_process() -> None:
    """In a process of its own: what fails here is a crash."""
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-500:]
    assert done.stdout.split() == ["4000"]
