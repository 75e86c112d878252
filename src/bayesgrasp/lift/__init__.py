"""The lift test p(S | h, O, p_O): screening, physics in two engines, and the criterion of success."""
