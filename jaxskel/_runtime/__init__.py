"""Use of the machine: processor cores, cache of compiled programs, batches of fixed shape, atomic files."""
