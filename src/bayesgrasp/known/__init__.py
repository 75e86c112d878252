"""A grasping problem whose posterior is known in closed form, to judge the whole chain by."""
