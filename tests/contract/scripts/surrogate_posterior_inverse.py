"""Stiffness of each record with its standard deviation: a prior and a noise that the records teach, or given ones."""

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.surrogate import PosteriorInverse

year = make_truss_campaign(random_state=0)
model, F = make_truss(), year.frequencies
learned = PosteriorInverse(model).fit(F)
theta, std = learned.transform(F, return_std=True)
given = PosteriorInverse(model, prior=0.2, noise=0.01).fit(F)
exact = given.transform(model.frequencies([[0.9, 1.1, 0.95, 1.0]]))
gaps = F[:3].copy()
gaps.iloc[0, 2], gaps.iloc[1] = float("nan"), float("nan")
RESULTS = {
    "common": learned.prior_.common,
    "mean": theta.mean()[["bottom", "top", "diagonal"]],
    "std": std.mean()[["bottom", "top", "diagonal"]],
    "noise": learned.noise_,
    "given": exact[:, :3],
    "gaps": learned.transform(gaps).isna().sum(axis=1).to_numpy(),
}
TOLERANCES = {
    "common": {"rtol": 0.1},
    "mean": {"rtol": 0.005},
    "std": {"rtol": 0.25},
    "noise": {"rtol": 0.15},
    "given": {"rtol": 1e-3},
}
