import optuna
from sklearn.linear_model import Ridge
from sklearn.model_selection import KFold, cross_val_score

fem.set_params(mapper=TemperatureMapper(Ridge()), memory="known")


def objective(trial):
    noise = trial.suggest_float("noise", 0.002, 0.02, log=True)
    alpha = trial.suggest_float("alpha", 0.1, 100.0, log=True)
    candidate = clone(fem).set_params(inverse__noise=noise, mapper__regressor__alpha=alpha)
    return cross_val_score(candidate, T, F, cv=KFold(3)).mean()


study = optuna.create_study(direction="maximize", sampler=optuna.samplers.TPESampler(seed=0))
study.optimize(objective, n_trials=3)
best = clone(fem).set_params(inverse__noise=study.best_params["noise"])
