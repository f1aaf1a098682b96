"""Roads from a problem to the air: each module solves `core.problem.Problem` into `core.result.Solution`."""
