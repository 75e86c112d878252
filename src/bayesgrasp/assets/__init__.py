"""Objects, gripper, arm, and the physics scene made of them."""
