"""What every estimator shares: checks of arguments, regressors, warnings, threads."""
