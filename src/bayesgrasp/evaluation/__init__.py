"""The strategies of the paper's table, judged by the lift test: scenes, runs, tables, figures."""
