"""The depth sensor p(i | O, p_O, camera): rays, structured light, stereo, and their noise."""
