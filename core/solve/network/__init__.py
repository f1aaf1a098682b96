"""The paper's network (T, p, u) and its optimisation."""
