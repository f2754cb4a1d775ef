"""Episodes of tasks, one or many at once: plans, rows, features, kernels."""
