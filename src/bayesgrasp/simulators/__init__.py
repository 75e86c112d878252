"""Generative models: the lift test p(S | h, O, p_O) and the depth sensor p(i | O, p_O, camera)."""
