"""How data are made: priors and simulators, chunks of records, and the processes that make them."""
