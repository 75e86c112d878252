"""From a depth image to ranked grasps that the arm can reach, and a picture of them."""
